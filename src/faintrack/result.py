"""What came out of a recording: frames as named variables with units, and the tracks in them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from faintrack.recording import Recording
from faintrack.scenario.model import Scenario
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import bearings
from faintrack.signal.frames import FrameBlock
from faintrack.trackers.single import Estimate
from faintrack.tracks import BearingTrack, bearing_tracks


@dataclass(frozen=True)
class Result:
    """What came out of a recording.

    Attributes
    ----------
    data : one entry a frame; existence, bearing, record and the rest, with units in their attributes.
    tracks : what was declared.
    scenario : what was run.
    array : whose recording it was.
    seconds : that the run took.
    """

    data: xr.Dataset
    tracks: list[BearingTrack]
    scenario: Scenario
    array: SensorArray
    seconds: float

    @property
    def existence(self) -> xr.DataArray:
        """Probability that a target exists, frame by frame."""
        return self.data.existence

    @property
    def bearing(self) -> xr.DataArray:
        """Bearing of the track in hand, degrees; not a number where there is none."""
        return self.data.bearing.where(self.data.label > 0)

    @property
    def record(self) -> xr.DataArray:
        """Bearing-time record: beam power over the sum of the channels' powers, mean over the band; dB.

        Noise without direction has 0 dB, a lone plane wave as many as the channels' number.
        """
        return self.data.record

    def summary(self) -> dict[str, Any]:
        """Tracks and speed as plain values, for programs.

        `seconds` is what the run took, `realtime_factor` the length of the recording over it, `masked_frames` the
        number of frames in which a channel was left out because a sample was not finite.
        """
        frames = self.data.sizes["time"]
        return {
            "tracks": [track.as_dict() for track in self.tracks],
            "frames": frames,
            "seconds": self.seconds,
            "realtime_factor": frames * self.scenario.analysis.frame / self.seconds,
            "masked_frames": int((self.data.masked_channels > 0).sum()),
        }


def tracks_of(data: xr.Dataset) -> list[BearingTrack]:
    """Tracks in the data of a result."""
    columns = (data[name].values for name in ("time", "label", "bearing", "bearing_std", "snr", "track_existence"))
    time, label, bearing, std, snr_db, existence = columns
    return bearing_tracks(time, label, np.radians(bearing), np.radians(std), snr_db, existence)


def frames_dataset(
    block: FrameBlock, estimates: Estimate, record: np.ndarray, array: SensorArray, recording: Recording
) -> xr.Dataset:
    """Blocks of estimates as named variables with units."""
    reference = "clockwise from north" if array.circular else "from the array axis"
    degrees = {"units": "degree", "reference": reference}
    beams = record.shape[1]
    bearing = np.degrees(bearings(beams, array.circular))

    def per_frame(values: Any, units: str, long_name: str, **more: str) -> tuple[str, np.ndarray, dict[str, str]]:
        return "time", np.asarray(values), {"units": units, "long_name": long_name, **more}

    deg = np.degrees
    masked = (~block.usable & array.alive).sum(axis=1).astype(np.int32)
    return xr.Dataset(
        {
            "existence": per_frame(estimates.existence, "1", "probability that a target exists"),
            "label": per_frame(estimates.label, "1", "track in hand, 0 where there is none"),
            "track_existence": per_frame(estimates.track_existence, "1", "probability that the track's target exists"),
            "bearing": per_frame(deg(estimates.mean.bearing), long_name="bearing", **degrees),
            "bearing_std": per_frame(deg(estimates.std.bearing), "degree", "standard deviation of the bearing"),
            "bearing_rate": per_frame(deg(estimates.mean.bearing_rate), "degree/s", "bearing rate"),
            "snr": per_frame(estimates.mean.snr_db, "dB", "signal to noise ratio at one channel"),
            "snr_std": per_frame(estimates.std.snr_db, "dB", "standard deviation of the signal to noise ratio"),
            "log_evidence": per_frame(estimates.log_evidence, "1", "log of the mean likelihood ratio"),
            "masked_channels": per_frame(masked, "1", "channels left out, samples not finite"),
            "record": (
                ("time", "beam"),
                record,
                {"units": "dB", "long_name": "beam power over the sum of the channels' powers"},
            ),
        },
        coords={
            "time": ("time", block.time, {"units": "s", "long_name": "time from the start of the recording"}),
            "beam": ("beam", bearing, {"long_name": "bearing", **degrees}),
        },
        attrs={
            "source": recording.source,
            "start_time": "" if recording.start_time is None else f"{recording.start_time}Z",
        },
    )
