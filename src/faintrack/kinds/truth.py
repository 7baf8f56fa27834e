"""Tracks against sources whose bearings are known."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import lobe_width
from faintrack.simulation.samples import Source


@dataclass(frozen=True)
class Finding:
    """A source, and what was found of it.

    Attributes
    ----------
    start_s : when the source appears; seconds.
    declared_s : first frame with a track within `within_deg` of it; None where there is none.
    bearing_rmse_deg : root mean square error of the bearing over those frames; degrees.
    snr_db, found_snr_db : true, and mean over those frames; dB.
    followed : share of the frames from the declaration on in which such a track is there.
    """

    start_s: float
    declared_s: float | None
    bearing_rmse_deg: float | None
    snr_db: float
    found_snr_db: float | None
    followed: float


def findings(data: xr.Dataset, sources: Sequence[Source], within_deg: float, circular: bool) -> list[Finding]:
    """What was found of each source.

    Parameters
    ----------
    data : of a result.
    sources : that are in the recording.
    within_deg : a track this close to a source is a track of it; degrees.
    circular : whether bearings run around the full circle, or are mirrored at the ends of a line.
    """
    found = []
    time, label = data.time.values, data.label.values
    for source in sources:
        off = _apart(data.bearing.values, np.degrees(source.bearing_at(time)), circular)
        present = (time >= source.start) & (time < source.end)
        near = present & (label > 0) & (off <= within_deg)
        if not near.any():
            found.append(Finding(source.start, None, None, source.snr_db, None, 0.0))
            continue
        since = present & (time >= time[near][0])
        found.append(
            Finding(
                source.start,
                float(time[near][0]),
                float(np.sqrt(np.mean(off[near] ** 2))),
                source.snr_db,
                float(data.snr.values[near].mean()),
                float(near[since].mean()),
            )
        )
    return found


def false_tracks(data: xr.Dataset, sources: Sequence[Source], within_deg: float, circular: bool) -> list[int]:
    """Labels of tracks that are never within `within_deg` of a source; arguments as in `findings`."""
    time, label = data.time.values, data.label.values
    explained = np.zeros(label.shape, bool)
    for source in sources:
        off = _apart(data.bearing.values, np.degrees(source.bearing_at(time)), circular)
        explained |= (off <= within_deg) & (time >= source.start) & (time < source.end)
    return sorted(set(label[label > 0].tolist()) - set(label[explained].tolist()))


def main_lobe_deg(array: SensorArray, band: tuple[float, float] | None, sample_rate: float) -> float:
    """Main lobe of an array at the top of a band, from its peak to its first null; degrees."""
    return math.degrees(lobe_width(array, sample_rate / 2 if band is None else band[1]))


def _apart(bearing_deg: np.ndarray, true_deg: np.ndarray, circular: bool) -> np.ndarray:
    """Angle between two bearings, at most 180 degrees."""
    if not circular:
        true_deg = np.abs((true_deg + 180) % 360 - 180)
    return np.abs((bearing_deg - true_deg + 180) % 360 - 180)
