"""What is sent to the page: a greeting, then one message a scan, an alarm or whatever else happens.

The greeting and events are texts of JSON. The greeting tells what is drawn: `columns` of the table, and `places`, which
of them tell where a target is; two are drawn as a map, one over time, with its ends where they are known. A scan is
binary: the length of its JSON, a whole number of 32 bits, little-endian; the JSON; and, of kinds that have one, the row
of the bearing-time record, one byte a beam on the scale `low_db` to `high_db` that the JSON tells.
"""

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from faintrack.kinds.door import Moment
from faintrack.live.lines import line
from faintrack.live.watching import Watching
from faintrack.results.schema import AXIS, column, places, units

LENGTH = struct.Struct("<I")

BEAMS = 2048
"""Of a row at most; neighbours of a longer one are joined, the louder one kept."""


def greeting(watch: Watching, moment: Moment) -> str:
    """What a page must know before the first scan.

    Parameters
    ----------
    watch, moment : of any scan.
    """
    scenario: Any = watch.plan.scenario
    data = moment.data
    told = units(data)
    return line(
        {
            "event": "greeting",
            "source": watch.source,
            "scan_interval": float(data.attrs["scan_interval"]),
            "start_time": data.attrs["start_time"],
            "columns": [
                {"name": column(name, unit), "title": _title(name), "unit": unit} for name, unit in told.items()
            ],
            "places": [
                {"name": column(name, told[name]), "unit": told[name], "ends": _ends(watch, data, name)}
                for name in places(data)
            ],
            "declare": scenario.tracker.declare,
            "drop": scenario.tracker.drop,
        }
    )


def scan_message(watch: Watching, moment: Moment, event: Mapping[str, Any]) -> bytes:
    """Message of a scan.

    Parameters
    ----------
    watch, moment : of the scan.
    event : of it, see `faintrack.live.lines.event_of`.
    """
    status = watch.status
    low, high, levels = _levels(moment.data)
    text = line(
        {
            **event,
            "low_db": low,
            "high_db": high,
            "status": {
                "behind_s": status.behind_s,
                "gaps": status.gaps,
                "missing_s": status.missing_s,
                "left_out": status.left_out,
                **watch.counts,
            },
        }
    ).encode()
    return LENGTH.pack(len(text)) + text + levels


def _levels(data: xr.Dataset) -> tuple[float, float, bytes]:
    """Lowest and highest level of the newest row of a bearing-time record, and its bytes; none where there is none."""
    if not _has_record(data):
        return 0.0, 0.0, b""
    row = data.record.values[-1].astype(float)
    if len(row) > BEAMS:
        joined = -(-len(row) // BEAMS)
        row = np.pad(row, (0, -len(row) % joined), mode="edge").reshape(-1, joined).max(axis=1)
    low, high = float(row.min()), float(row.max())
    return low, high, np.round((row - low) / max(high - low, 1e-9) * 255).astype(np.uint8).tobytes()


def _has_record(data: xr.Dataset) -> bool:
    return "record" in data and data.record.dims[1:] == ("beam",)


def _title(name: str) -> str:
    """Heading of a column."""
    words = {"bearing_rate": "Rate", "snr_db": "SNR"}
    # Letters of axes are written as they are.
    return words.get(name, name.replace("_", " ").capitalize() if len(name) > 2 else name)


def _ends(watch: Watching, data: xr.Dataset, name: str) -> list[float] | None:
    """First and last value of a component of the place, where they are known."""
    if name == "bearing":
        if _has_record(data):
            return [float(data.beam[0]), float(data.beam[-1])]
        return [0.0, 180.0] if data.bearing.attrs["reference"] == AXIS else [-180.0, 180.0]
    axis = f"axis_{name}"
    if axis in data:
        return [float(data[axis][0]), float(data[axis][-1])]
    limits = watch.plan.limits or {}
    return list(limits[name]) if name in limits else None
