"""Alarms: the rules of a scenario applied to each scan, each told once for each track."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import xarray as xr

from faintrack.errors import InputError
from faintrack.results.schema import column, units
from faintrack.scenario.alarm import AlarmSection

BEARING = "bearing_deg"
"""Name of a bearing in the event of a scan."""

MOST = 10_000
"""Pairs of rule and label that are remembered."""

ROUNDING = 1e-6
"""Seconds by which the difference of two times may be off."""


@dataclass
class AlarmBell:
    """What rules have seen so far.

    Attributes
    ----------
    rules : of the scenario.
    since : when a track came to be as its rule says; seconds, by the number of the rule and the label.
    told : of which pairs the alarm was given.
    """

    rules: Sequence[AlarmSection]
    since: dict[tuple[int, int], float] = field(default_factory=dict)
    told: dict[tuple[int, int], None] = field(default_factory=dict)

    def take(self, event: Mapping[str, Any]) -> Iterator[tuple[AlarmSection, dict[str, Any]]]:
        """Yield the alarms of a scan, with their rules.

        Parameters
        ----------
        event : of the scan, see `faintrack.live.lines.event_of`.

        Examples
        --------
        >>> bell = AlarmBell([AlarmSection(name="south", sector=(170, -170), longer_than=2.0)])
        >>> def scan(time, bearing):
        ...     return {"time": time, "tracks": [{"label": 1, "existence": 0.99, "bearing_deg": bearing}]}
        >>> [len(list(bell.take(scan(time, bearing)))) for time, bearing in enumerate([160, 175, 179, -178, -175])]
        [0, 0, 0, 1, 0]
        """
        time = float(event["time"])
        inside: dict[tuple[int, int], float] = {}
        for number, rule in enumerate(self.rules):
            for track in event["tracks"]:
                pair = number, int(track["label"])
                if not _is_in(track, rule):
                    continue
                inside[pair] = self.since.get(pair, time)
                if time - inside[pair] >= rule.longer_than - ROUNDING and pair not in self.told:
                    self.told[pair] = None
                    utc = {"utc": event["utc"]} if "utc" in event else {}
                    yield rule, {"event": "alarm", "name": rule.name, "when": rule.when, "time": time, **utc, **track}
        self.since = inside
        while len(self.told) > MOST:
            del self.told[next(iter(self.told))]

    def saved(self) -> dict[str, Any]:
        """Plain values from which `restored` makes the same."""
        return {
            "since": [[*pair, time] for pair, time in self.since.items()],
            "told": [list(pair) for pair in self.told],
        }


def restored(rules: Sequence[AlarmSection], saved: Mapping[str, Any]) -> AlarmBell:
    """A bell as it was, so that a run that goes on tells nothing twice.

    Parameters
    ----------
    rules : of the scenario.
    saved : by `AlarmBell.saved`; empty at first.
    """
    since = {(int(rule), int(label)): float(time) for rule, label, time in saved.get("since", ())}
    return AlarmBell(rules, since, {(int(rule), int(label)): None for rule, label in saved.get("told", ())})


def require_components(rules: Sequence[AlarmSection], data: xr.Dataset) -> None:
    """Refuse rules of what tracks do not have.

    Parameters
    ----------
    rules : of the scenario.
    data : of any scan.

    Raises
    ------
    InputError : a sector is asked for of tracks that have no bearing, or a region of components that they do not have.
    """
    known = [column(name, unit) for name, unit in units(data).items()]
    for rule in rules:
        if rule.sector is not None and BEARING not in known:
            raise InputError(
                f"alarm {rule.name}: sector is of bearings, and tracks of {data.attrs['kind']} have "
                f"{', '.join(known)}; expected a region such as region = {{{known[0]} = [0, 100]}}."
            )
        for name in rule.region or ():
            if name not in known:
                raise InputError(f"alarm {rule.name}: region has {name}; expected some of {', '.join(known)}.")


def _is_in(track: Mapping[str, Any], rule: AlarmSection) -> bool:
    """Whether a track is where a rule is of. What is not known is nowhere."""
    inside = all(low <= float(track[name]) <= high for name, (low, high) in (rule.region or {}).items())
    return inside and (BEARING not in track or in_sector(float(track[BEARING]), rule.sector))


def in_sector(bearing: float, sector: tuple[float, float] | None) -> bool:
    """Whether a bearing lies in a sector; degrees, the sector from its first edge on in growing bearings.

    Examples
    --------
    >>> in_sector(10.0, (350.0, 20.0)), in_sector(10.0, (20.0, 350.0)), in_sector(10.0, None)
    (True, False, True)
    """
    if not math.isfinite(bearing):
        return False
    if sector is None or sector[1] - sector[0] >= 360:
        return True
    return (bearing - sector[0]) % 360 <= (sector[1] - sector[0]) % 360
