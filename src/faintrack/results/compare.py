r"""Two results of the same scene beside each other: tracks matched, how far they are apart, where they differ.

In every scan that both have, the tracks of one are assigned to those of the other so that the distance of the two sets
is least (GOSPA of order 2, `faintrack.metrics.sets.gospa`); a pair farther apart than `within` is none. Tracks that
share a scan so are a pair. Where both know UTC, their scans are laid beside each other on that clock, otherwise by
their times.
"""

import math
from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from faintrack.errors import InputError
from faintrack.metrics.sets import SetDistance, gospa
from faintrack.results.result import Result
from faintrack.results.schema import deviations, places, units

SIGMAS = 4.0
"""`within` over the deviations of both results, where it is not given."""


@dataclass(frozen=True)
class Pair:
    """A track of each result.

    Attributes
    ----------
    first, second : labels.
    scans : that they share.
    from_s, to_s : first and last of these, on the clock of the first result; seconds.
    rms : root mean square of their distance there; unit of the place.
    """

    first: int
    second: int
    scans: int
    from_s: float
    to_s: float
    rms: float


@dataclass(frozen=True)
class Difference:
    """Consecutive scans in which one result has tracks that the other has not.

    Attributes
    ----------
    from_s, to_s : first and last of them, on the clock of the first result; seconds.
    only_first, only_second : labels of these tracks.
    """

    from_s: float
    to_s: float
    only_first: tuple[int, ...]
    only_second: tuple[int, ...]


@dataclass(frozen=True)
class Comparison:
    """Two results beside each other.

    Attributes
    ----------
    scans : that both have.
    within : pairs are nearer than this; unit of the place.
    unit : of the place.
    pairs : tracks that are the same, by label.
    only_first, only_second : labels of tracks without a partner in any scan.
    gospa : root mean square over scans; unit of the place, as the parts below, whose squares add up to its square.
    localisation, missing, extra : parts of pairs, of tracks of the first and of tracks of the second without a partner.
    differences : where they differ, in the order of time.
    fields : of the scenarios that differ, with the value in each as text.
    """

    scans: int
    within: float
    unit: str
    pairs: tuple[Pair, ...]
    only_first: tuple[int, ...]
    only_second: tuple[int, ...]
    gospa: float
    localisation: float
    missing: float
    extra: float
    differences: tuple[Difference, ...]
    fields: dict[str, tuple[str, str]]

    def as_dict(self) -> dict[str, Any]:
        """Plain values for programs."""
        return asdict(self)


def compare(first: Result, second: Result, within: float | None = None) -> Comparison:
    """Lay two results of the same scene beside each other.

    Parameters
    ----------
    first, second : with the same place.
    within : distance beyond which two tracks are not the same, in the unit of the place; four times the root mean
        square deviation of the places of both where not given.

    Raises
    ------
    InputError : places are not the same, no scan is of the same time, or `within` is not above 0.
    """
    of, names = units(first.data), places(first.data)
    theirs = {name: units(second.data)[name] for name in places(second.data)}
    if {name: of[name] for name in names} != theirs:
        listed = [", ".join(f"{name} in {unit}" for name, unit in one.items()) for one in (_place(first), theirs)]
        raise InputError(
            f"one result tells {listed[0]}, the other {listed[1]}; expected two results of the same place."
        )
    if within is not None and not (math.isfinite(within) and within > 0):
        raise InputError(f"within is {within:g}; expected a number above 0.")
    within = _within(first, second) if within is None else within
    round_the_circle = np.array([of[name] == "degree" for name in names])

    def distance(found: np.ndarray, true: np.ndarray) -> np.ndarray:
        away = found - true
        return np.asarray(np.linalg.norm(np.where(round_the_circle, (away + 180) % 360 - 180, away), axis=-1))

    parts: list[SetDistance] = []
    times: list[float] = []
    apart: dict[tuple[int, int], list[tuple[float, float]]] = {}
    lonely: list[tuple[tuple[int, ...], tuple[int, ...]]] = []
    mine, other = _tracked(first, names), _tracked(second, names)
    for here, there in _same_scans(first, second):
        (labels, states), (other_labels, other_states) = mine[here], other[there]
        part = gospa(other_states, states, within, distance=distance)
        parts.append(part)
        times.append(float(first.data.time[here]))
        for found, true in part.pairs:
            if found >= 0 and true >= 0:
                away = float(distance(other_states[found], states[true]))
                apart.setdefault((labels[true], other_labels[found]), []).append((times[-1], away))
        alone = part.pairs[part.pairs[:, 0] < 0, 1], part.pairs[part.pairs[:, 1] < 0, 0]
        lonely.append((tuple(labels[k] for k in alone[0]), tuple(other_labels[k] for k in alone[1])))
    pairs = tuple(_pair(labels, shared) for labels, shared in sorted(apart.items()))
    roots = {
        name: float(np.sqrt(np.mean([getattr(part, name) for part in parts])))
        for name in ("localisation", "missed", "false")
    }
    return Comparison(
        scans=len(parts),
        within=within,
        unit=of[names[0]],
        pairs=pairs,
        only_first=_others(first, {pair.first for pair in pairs}),
        only_second=_others(second, {pair.second for pair in pairs}),
        gospa=math.hypot(*roots.values()),
        localisation=roots["localisation"],
        missing=roots["missed"],
        extra=roots["false"],
        differences=_stretches(times, lonely),
        fields=_fields(first.scenario, second.scenario),
    )


def _place(result: Result) -> dict[str, str]:
    return {name: units(result.data)[name] for name in places(result.data)}


def _within(first: Result, second: Result) -> float:
    """Four times the root mean square deviation of the places of all tracks; 1 where there is none."""
    squares = []
    for result in (first, second):
        std, held = deviations(result.data), result.data.label.values > 0
        squares += [std[name].values[held] ** 2 for name in places(result.data)]
    known = np.concatenate(squares)
    known = known[np.isfinite(known)]
    return SIGMAS * float(np.sqrt(known.mean())) if known.size and known.any() else 1.0


def _tracked(result: Result, names: list[str]) -> list[tuple[list[int], np.ndarray]]:
    """Labels and places of the tracks in every scan."""
    label = result.data.label.values
    place = np.stack([result.data[name].values for name in names], axis=-1).astype(float)
    held = (label > 0) & np.isfinite(place).all(axis=-1)
    return [(label[scan, held[scan]].tolist(), place[scan, held[scan]]) for scan in range(len(label))]


def _same_scans(first: Result, second: Result) -> list[tuple[int, int]]:
    """Numbers of scans of the same time: each with the nearest of the other, half an interval away at most."""
    starts = [result.data.attrs.get("start_time") or None for result in (first, second)]
    later = 0.0
    if all(starts):
        begun = [np.datetime64(str(start).removesuffix("Z"), "ns") for start in starts]
        later = float((begun[1] - begun[0]) / np.timedelta64(1, "s"))
    times, others = np.asarray(first.data.time, float), np.asarray(second.data.time, float) + later
    after = np.searchsorted(others, times).clip(1, max(len(others) - 1, 1))
    near = np.where(times - others[after - 1] <= others[np.minimum(after, len(others) - 1)] - times, after - 1, after)
    near = near.clip(0, len(others) - 1)
    half = 0.5001 * max(float(result.data.attrs["scan_interval"]) for result in (first, second))
    same = [(here, int(there)) for here, there in enumerate(near) if abs(times[here] - others[there]) <= half]
    if not same:
        raise InputError("the two results have no scan of the same time; expected results of the same data.")
    return same


def _pair(labels: tuple[int, int], shared: list[tuple[float, float]]) -> Pair:
    times, away = np.array(shared).T
    return Pair(*labels, len(times), float(times[0]), float(times[-1]), float(np.sqrt(np.mean(away**2))))


def _others(result: Result, matched: set[int]) -> tuple[int, ...]:
    return tuple(track.label for track in result.tracks if track.label not in matched)


def _stretches(times: list[float], lonely: list[tuple[tuple[int, ...], tuple[int, ...]]]) -> tuple[Difference, ...]:
    """Consecutive scans with the same tracks without a partner."""
    stretches: list[Difference] = []
    before: Any = ((), ())
    for time, sides in zip(times, lonely, strict=True):
        if any(sides):
            begun = stretches.pop().from_s if sides == before else time
            stretches.append(Difference(begun, time, *sides))
        before = sides
    return tuple(stretches)


def _fields(first: Any, second: Any) -> dict[str, tuple[str, str]]:
    """Fields of two scenarios that differ."""
    one, other = (dict(_flat(scenario.model_dump(exclude_none=True, mode="json"))) for scenario in (first, second))
    names = Counter([*one, *other])
    return {name: (one.get(name, ""), other.get(name, "")) for name in names if one.get(name) != other.get(name)}


def _flat(table: dict[str, Any], above: str = "") -> list[tuple[str, str]]:
    """Names with dots and values as text."""
    flat = []
    for name, value in table.items():
        flat += _flat(value, f"{above}{name}.") if isinstance(value, dict) else [(above + name, str(value))]
    return flat
