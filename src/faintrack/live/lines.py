"""What is known of a scan as one line of JSON, for programs."""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from faintrack.kinds.door import Moment
from faintrack.results.schema import column
from faintrack.results.track import Track


def event_of(moment: Moment) -> dict[str, Any]:
    """Event of a scan: its number and time, the largest existence, and every track with its state and deviations.

    Parameters
    ----------
    moment : of one scan.

    Returns
    -------
    Plain values. Names carry units, as in the tables of a result: `bearing_deg`, `bearing_deg_std`. What is not known
    is None.
    """
    event: dict[str, Any] = {"event": "scan", "scan": moment.checkpoint.scans - 1, "time": moment.time}
    tracks = moment.tracks
    start = moment.data.attrs.get("start_time")
    if start:
        utc = np.datetime64(start.removesuffix("Z"), "ns") + np.timedelta64(round(moment.time * 1e9), "ns")
        event["utc"] = f"{utc.astype('datetime64[ms]')}Z"
    return {**event, "existence": moment.existence, "tracks": [_row(track) for track in tracks]}


def line(event: Mapping[str, Any]) -> str:
    """An event as one line; numbers that are none are null.

    Examples
    --------
    >>> line({"event": "gap", "time": 1.5, "seconds": float("nan")})
    '{"event": "gap", "time": 1.5, "seconds": null}'
    """
    return json.dumps(_plain(event), allow_nan=False)


def _row(track: Track) -> dict[str, Any]:
    row: dict[str, Any] = {"label": track.label, "existence": float(track.existence[-1])}
    std = track.std
    for name, values in track.mean.items():
        title = column(name, track.units[name])
        row[title], row[f"{title}_std"] = float(values[-1]), float(std[name][-1])
    return row


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, float):
        # Digits beyond those of single precision would only make lines longer.
        return float(f"{value:.9g}") if math.isfinite(value) else None
    return value
