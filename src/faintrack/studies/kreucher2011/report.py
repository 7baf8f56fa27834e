"""What is read off the runs: the study's rows.

A track is held to be that of a target as long as it is within `CUTOFF` of it; one that is not, in most of its scans, of
any target is false. GOSPA has the same cutoff and order 2; it, errors and triangulation are taken over the scans from
`SETTLED` on. In a close pass a target is **lost** where a track of the two has ended by the last scan, the two are
**merged** where both tracks are then nearer to the same target, and **swapped** where each is nearer to the target that
was the other's before. Numbers of close passes come from trackers that start near the truth, so that there are many
runs; those with `_whole` from the whole tracker.

Intervals of shares are exact, others by bootstrap over the runs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import xarray as xr

from faintrack.metrics.intervals import binomial_interval, bootstrap_interval
from faintrack.metrics.sets import gospa
from faintrack.studies.kreucher2011 import runs, scene
from faintrack.studies.kreucher2011.settings import APART, COUNTS
from faintrack.studies.kreucher2011.triangulation import crossing
from faintrack.studies.study import Results, Row, finished

CUTOFF = 50.0
"""Farthest that a track is held to be that of a target; m."""

SETTLED = 40
"""Scan from which tracks are compared with targets."""

BOOTSTRAPS = 400
"""Draws of runs for an interval."""

WHOLE = {
    "synthetic": "",
    "coarse": ", velocities of 3 m/s in the detectors",
    "coarse_separate": ", velocities of 3 m/s, never updated jointly",
}
"""Settings of the whole tracker, and what sets them apart."""


@dataclass(frozen=True)
class Tracks:
    """Tracks and targets of one run.

    Attributes
    ----------
    label : shape (scan, slot); 0 where there is no track.
    place : shape (scan, slot, 2); m.
    true : shape (scan, target, 2); m.
    """

    label: np.ndarray
    place: np.ndarray
    true: np.ndarray

    @property
    def apart(self) -> np.ndarray:
        """Distance of every track from every target, shape (scan, slot, target); infinite where there is no track."""
        apart = np.linalg.norm(self.place[:, :, None] - self.true[:, None], axis=-1)
        return np.where(self.label[:, :, None] > 0, apart, np.inf)

    def first(self) -> np.ndarray:
        """Scan, counted from 1, in which each target has a track for the first time; infinite where never."""
        near = (self.apart < CUTOFF).any(axis=1)
        return np.where(near.any(axis=0), 1.0 + near.argmax(axis=0), np.inf)

    def false(self) -> int:
        """Tracks that are those of no target."""
        nearest = self.apart.min(axis=2, initial=np.inf)
        labels = np.unique(self.label[self.label > 0])
        return int(sum(np.median(nearest[self.label == label]) >= CUTOFF for label in labels))

    def distances(self) -> list[tuple[float, float, int]]:
        """GOSPA, sum of squared errors and number of pairs of every scan from `SETTLED` on."""
        found = []
        for label, place, true in list(zip(self.label, self.place, self.true, strict=True))[SETTLED - 1 :]:
            each = gospa(place[label > 0], true, CUTOFF)
            found.append((each.total, each.localisation, int((each.pairs >= 0).all(axis=1).sum())))
        return found


def tracks_of(data: xr.Dataset) -> list[Tracks]:
    """Runs of a setting; without the targets that are not there."""
    label = data.label if "label" in data else data.active * (1 + np.arange(data.sizes["slot"]))
    place = np.stack([data.x.values, data.y.values], axis=-1)
    true = np.stack([data.true_x.values, data.true_y.values], axis=-1)
    there = np.isfinite(true[0, 0, :, 0])
    return [Tracks(*each) for each in zip(label.values, place, true[:, :, there], strict=True)]


def rows(results: Results) -> list[Row]:
    """The study's numbers; a setting that has not run leaves its rows out."""
    found: list[Row] = []
    for name, told in WHOLE.items():
        data = finished(results, name)
        if data is not None:
            found += _whole(name, told, data)
    for level in scene.LEVELS:
        found += _level(results, level)
    for count in COUNTS:
        data = finished(results, f"crowd_{count}")
        if data is not None:
            found += rows_of_crowd(count, data)
    for beams in APART:
        found += rows_of_pair(results, beams)
    return found


def handed_over(data: xr.Dataset) -> np.ndarray:
    """Scan in which the last track that is there at `SETTLED` was handed over, for every run."""
    label, existence = (data[name].values[:, :SETTLED] for name in ("label", "existence"))
    # The last scan without a target in the slot is that of the hand-over.
    free = SETTLED - np.argmax(existence[:, ::-1] == 0, axis=1)
    return np.where(label[:, -1] > 0, free, 0).max(axis=1)


def before_and_after(tracks: Sequence[Tracks], before: int) -> dict[str, np.ndarray]:
    """What came of the two tracks of the targets that meet, for every run that has both at scan `before`."""
    found: dict[str, list[bool]] = {"lost": [], "merged": [], "swapped": []}
    for each in tracks:
        close = list(scene.CLOSE) if each.true.shape[1] > len(scene.CLOSE) else [0, 1]
        apart = each.apart[before - 1][:, close]
        slots = apart.argmin(axis=0)
        if slots[0] == slots[1] or apart.min(axis=0).max() >= CUTOFF:
            continue
        labels = each.label[before - 1][slots]
        last = [np.flatnonzero(each.label[-1] == label) for label in labels]
        alive = all(len(slot) for slot in last)
        nearest = each.apart[-1][[slot[0] for slot in last]][:, close].argmin(axis=1) if alive else np.array([0, 1])
        found["lost"].append(not alive)
        found["merged"].append(alive and nearest[0] == nearest[1])
        found["swapped"].append(alive and nearest.tolist() == [1, 0])
    return {name: np.array(values, bool) for name, values in found.items()}


def _whole(name: str, told: str, data: xr.Dataset) -> list[Row]:
    tracks = tracks_of(data)
    first = np.array([each.first() for each in tracks])
    passed = before_and_after(tracks, runs.FROM)
    joint = (data.joint.values & (data.label.values > 0)).any(axis=2)[:, runs.FROM :].sum(axis=1)
    key = "" if name == "synthetic" else f"{name}_"
    found = [
        _mean(f"{key}declared_mean", f"targets that get a track{told}", "1", 3.0, np.isfinite(first).sum(axis=1)),
        _mean(f"{key}false_tracks_mean", f"false tracks{told}", "1", 0.0, [each.false() for each in tracks]),
        _median(
            f"{key}declaration_scan_last",
            f"scan in which the last target is declared, median{told}",
            10.0,
            first.max(axis=1),
        ),
        _median(
            f"{key}handover_scan_last",
            f"scan in which the last target is handed over, median{told}",
            9.0,
            handed_over(data),
        ),
        *(
            _share(f"{key}{what}_in_close_pass_whole", f"{what} in the close pass, whole tracker{told}", paper, values)
            for (what, values), paper in zip(passed.items(), (0.0, 0.0, None), strict=True)
        ),
        *_distances(key, told, tracks),
        _mean(f"{key}joint_scans", f"scans of joint updates from scan {runs.FROM} on{told}", "scan", 43.0, joint),
    ]
    for kind, what in (("tracked", "bearings tracked, then intersected"), ("exact", "true beams intersected")):
        off = data[kind].values - np.stack([data.true_x.values, data.true_y.values], axis=-1)
        squares = (off[:, SETTLED - 1 :] ** 2).sum(axis=-1).mean(axis=(1, 2))
        label = "rmse_triangulated_m" if kind == "tracked" else "rmse_true_beams_m"
        found.append(_root(f"{key}{label}", f"error, {what}{told}", squares))
    return found


def _level(results: Results, level: float) -> list[Row]:
    found, louder = [], f"beams of level {level:g}"
    data = finished(results, f"level_{level:g}")
    if data is not None:
        tracks = tracks_of(data)
        first = np.array([each.first() for each in tracks])
        key = f"level_{level:g}"
        found += [
            _mean(
                f"{key}_declared",
                f"targets with a track by scan {data.sizes['scan']}, {louder}",
                "1",
                3.0,
                np.isfinite(first).sum(axis=1),
            ),
            _mean(f"{key}_false", f"false tracks, {louder}", "1", 0.0, [each.false() for each in tracks]),
            _median(f"{key}_declaration_scan", f"scan of a target's declaration, median, {louder}", None, first),
            _median(
                f"{key}_handover_scan_last",
                f"scan in which the last target is handed over, median of the runs that declare three, {louder}",
                9.0,
                handed_over(data)[(data.label.values[:, SETTLED - 1] > 0).sum(axis=1) == len(scene.STARTS)],
            ),
        ]
    for name, how in (("", ""), ("_separate", ", never updated jointly")):
        data = finished(results, f"close_{level:g}{name}")
        if data is None:
            continue
        mine = level == scene.LEVEL
        passed = before_and_after(tracks_of(data), 1)
        for what, values in passed.items():
            plain = "swaps" if what == "swapped" else f"{what}_in_close_pass"
            key = f"{plain}{name}" if mine else f"level_{level:g}_{plain}{name}"
            paper = 0.0 if mine and not name and what != "swapped" else None
            found.append(_share(key, f"{what} in the close pass, {louder}{how}", paper, values))
    return found


def rows_of_crowd(count: int, data: xr.Dataset) -> list[Row]:
    """Of so many targets at once: those found, false tracks, GOSPA."""
    tracks, told = tracks_of(data), f"{count} targets"
    last = [gospa(each.place[-1][each.label[-1] > 0], each.true[-1], CUTOFF) for each in tracks]
    pairs = np.array([(each.pairs >= 0).all(axis=1).sum() for each in last])
    false = np.array([(each.pairs[:, 1] < 0).sum() for each in last])
    key = f"crowd_{count}"
    found = [
        _mean(f"{key}_found", f"{told}: those with a track at scan {scene.CROWD_SCANS}", "1", float(count), pairs),
        _mean(f"{key}_false", f"{told}: tracks of none at scan {scene.CROWD_SCANS}", "1", 0.0, false),
        *_distances(f"{key}_", f", {told}", tracks, errors=False),
    ]
    if count == 2:
        stay = np.array([ghosts_stay(each.true) for each in tracks])
        where = f"both ghosts stay in the region for {SETTLED} scans, no faster than targets"
        found.append(_share(f"{key}_ghosts", f"{told}: runs in which {where}", None, stay))
        for name, which, each in (("ghosts", stay, f"where {where}"), ("clear", ~stay, "in the other runs")):
            found.append(_mean(f"{key}_found_{name}", f"{told}: found {each}", "1", 2.0, pairs[which]))
            found.append(_mean(f"{key}_false_{name}", f"{told}: tracks of none {each}", "1", 0.0, false[which]))
    return found


def ghosts_stay(true: np.ndarray) -> bool:
    """Whether both places where the beams of one target cross those of another might be targets up to `SETTLED`.

    Parameters
    ----------
    true : shape (scan, target, 2); m. The first two are looked at.

    Examples
    --------
    >>> scan = np.arange(80.0)[:, None, None]
    >>> ghosts_stay(np.array([[300.0, 800.0], [400.0, 800.0]]) + 0 * scan)
    True
    >>> ghosts_stay(np.array([[100.0, 400.0], [1300.0, 400.0]]) + 0 * scan)
    False
    """
    stations = scene.stations()
    east, north = np.moveaxis(true[:SETTLED, None, :2] - np.stack([stations.x, stations.y], axis=-1)[:, None], -1, 0)
    bearings = np.arctan2(north, east)
    bearings[:, 1] = bearings[:, 1, ::-1]
    ghosts = np.asarray(crossing(stations, jnp.asarray(bearings)))
    low, high = np.transpose(scene.REGION)
    inside = (ghosts > low) & (ghosts < high)
    return bool(inside.all() and (np.abs(np.diff(ghosts, axis=0)) < scene.SPEED.edges[-1]).all())


def rows_of_pair(results: Results, beams: float) -> list[Row]:
    """Of two targets side by side, so many beams apart."""
    found, told = [], f"two targets side by side, {beams:g} beams apart"
    for name, what in (
        ("found", "both have a track at the end, one detector"),
        ("kept", "both are held to the end from a start near them"),
        ("kept_separate", "the same, never updated jointly"),
    ):
        setting = name.replace("_separate", f"_{beams:g}_separate") if "_" in name else f"{name}_{beams:g}"
        data = finished(results, setting)
        if data is None:
            continue
        last = [gospa(e.place[-1][e.label[-1] > 0], e.true[-1], CUTOFF).pairs for e in tracks_of(data)]
        both = np.array([len(pairs) == 2 and bool((pairs >= 0).all()) for pairs in last])
        found.append(_share(f"apart_{beams:g}_{name}", f"{told}: {what}", None, both))
        if name != "found":
            found += _distances(f"apart_{beams:g}_{name}_", f", {told}, {what}", tracks_of(data), errors=False)
    return found


def _distances(key: str, told: str, tracks: Sequence[Tracks], errors: bool = True) -> list[Row]:
    each = np.array([run.distances() for run in tracks])
    found = [_mean(f"{key}gospa", f"GOSPA, cutoff {CUTOFF:g} m{told}", "m", None, each[:, :, 0].mean(axis=1))]
    if errors:
        pairs = each[:, :, 2].sum(axis=1)
        squares = each[:, :, 1].sum(axis=1) / np.maximum(pairs, 1)
        found.insert(0, _root(f"{key}rmse_m", f"error of tracks{told}", squares[pairs > 0]))
    return found


def _mean(key: str, name: str, unit: str, paper: float | None, values: Sequence[float] | np.ndarray) -> Row:
    each = np.asarray(values, float)
    if not len(each):
        return Row(key, name, unit, paper, None)
    return Row(key, name, unit, paper, float(each.mean()), _bootstrapped(lambda runs: float(runs.mean()), each))


def _median(key: str, name: str, paper: float | None, scans: np.ndarray) -> Row:
    def middle(runs: np.ndarray) -> float:
        return float(np.median(runs))

    if not len(scans):
        return Row(key, name, "scan", paper, None)
    return Row(key, name, "scan", paper, middle(scans), _bootstrapped(middle, scans))


def _root(key: str, name: str, squares: np.ndarray) -> Row:
    def root(runs: np.ndarray) -> float:
        return float(np.sqrt(runs.mean()))

    return Row(key, name, "m", None, root(squares), _bootstrapped(root, squares))


def _share(key: str, name: str, paper: float | None, values: np.ndarray) -> Row:
    if not len(values):
        return Row(key, name, "1", paper, None)
    low, high = binomial_interval(int(values.sum()), len(values))
    return Row(key, name, "1", paper, float(values.mean()), (float(low), float(high)))


def _bootstrapped(statistic: Callable[[np.ndarray], float], values: np.ndarray) -> tuple[float | None, float | None]:
    if len(values) < 2:
        return None, None
    # A median of scans may be infinite, where most targets are never declared.
    with np.errstate(invalid="ignore"):
        low, high = bootstrap_interval(statistic, values, BOOTSTRAPS)
    return float(low), float(high)
