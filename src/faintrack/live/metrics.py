"""How a watch stands, in the text format of Prometheus (exposition format 0.0.4)."""

import math
from collections.abc import Mapping
from typing import Any

from faintrack.live.watching import Status


def exposition(status: Status, counts: Mapping[str, int], event: Mapping[str, Any]) -> str:
    """Text that a Prometheus server reads.

    Parameters
    ----------
    status : of the watch.
    counts : what went wrong on the way, by name.
    event : of the last scan, see `faintrack.live.lines.event_of`.

    Examples
    --------
    >>> event = {"time": 12.5, "existence": 0.25, "tracks": []}
    >>> print(exposition(Status(scans=25, behind_s=0.5), {"lost": 3}, event).splitlines()[1])
    faintrack_scans_total 25
    """
    rows = [
        ("scans_total", "counter", status.scans),
        ("left_out_scans_total", "counter", status.left_out),
        ("gaps_total", "counter", status.gaps),
        ("missing_seconds_total", "counter", status.missing_s),
        ("behind_seconds", "gauge", status.behind_s),
        ("time_seconds", "gauge", float(event["time"])),
        ("existence", "gauge", float(event["existence"])),
        ("tracks", "gauge", len(event["tracks"])),
    ]
    lines = []
    for name, kind, value in rows:
        lines += [f"# TYPE faintrack_{name} {kind}", f"faintrack_{name} {_number(value)}"]
    if counts:
        lines.append("# TYPE faintrack_packets_total counter")
        lines += [f'faintrack_packets_total{{what="{name}"}} {count}' for name, count in sorted(counts.items())]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return f"{value:.12g}" if math.isfinite(value) else "NaN"
