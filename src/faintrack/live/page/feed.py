"""What is sent to the page: a greeting, then one message a scan, an alarm or whatever else happens.

The greeting and events are texts of JSON. A scan is binary: the length of its JSON, a whole number of 32 bits,
little-endian; the JSON; and the row of the bearing-time record, one byte a beam on the scale `low_db` to `high_db` that
the JSON tells.
"""

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from faintrack.kinds.door import Moment
from faintrack.live.lines import line
from faintrack.live.watch import Watch

LENGTH = struct.Struct("<I")

BEAMS = 2048
"""Of a row at most; neighbours of a longer one are joined, the louder one kept."""


def greeting(watch: Watch, moment: Moment) -> str:
    """What a page must know before the first scan.

    Parameters
    ----------
    watch, moment : of any scan.
    """
    scenario: Any = watch.plan.scenario
    data = moment.data
    beams = data.beam.values
    return line(
        {
            "event": "greeting",
            "source": watch.stream.source,
            "scan_interval": float(data.attrs["scan_interval"]),
            "start_time": data.attrs["start_time"],
            "first_beam_deg": float(beams[0]),
            "last_beam_deg": float(beams[-1]),
            "reference": str(data.beam.attrs["reference"]),
            "declare": scenario.tracker.declare,
            "drop": scenario.tracker.drop,
        }
    )


def scan_message(watch: Watch, moment: Moment, event: Mapping[str, Any]) -> bytes:
    """Message of a scan.

    Parameters
    ----------
    watch, moment : of the scan.
    event : of it, see `faintrack.live.lines.event_of`.
    """
    row = moment.data.record.values[-1].astype(float)
    if len(row) > BEAMS:
        joined = -(-len(row) // BEAMS)
        row = np.pad(row, (0, -len(row) % joined), mode="edge").reshape(-1, joined).max(axis=1)
    low, high = float(row.min()), float(row.max())
    status = watch.status
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
                **watch.stream.counts,
            },
        }
    ).encode()
    levels = np.round((row - low) / max(high - low, 1e-9) * 255).astype(np.uint8)
    return LENGTH.pack(len(text)) + text + levels.tobytes()
