"""What is read off the runs: the study's rows.

What counts as a track of a target, and how close passes end, is told in `tracks`. Numbers of close passes come from
trackers that start near the truth, so that there are many runs; those with `_whole` from the whole tracker.

Intervals of shares are exact, others by bootstrap over the runs.
"""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from faintrack.studies.kreucher2011 import runs, scene
from faintrack.studies.kreucher2011.settings import APART, COUNTS
from faintrack.studies.kreucher2011.tracks import (
    CUTOFF,
    SETTLED,
    Tracks,
    before_and_after,
    ghosts_stay,
    handed_over,
    tracks_of,
)
from faintrack.studies.printed import PRINTED
from faintrack.studies.rows import beside, bootstrapped, mean, share
from faintrack.studies.study import Results, Row, finished, ran

WHOLE = {
    "synthetic": "",
    "coarse": ", velocities of 3 m/s in the detectors",
    "coarse_separate": ", velocities of 3 m/s, never updated jointly",
}
"""Settings of the whole tracker, and what sets them apart."""


def rows(results: Results) -> list[Row]:
    """The study's numbers; a setting that has not run leaves its rows out."""
    crowds = ran(results, {count: f"crowd_{count}" for count in COUNTS})
    ours = [
        *(row for name, data in ran(results, {name: name for name in WHOLE}).items() for row in _whole(name, data)),
        *(row for level in scene.LEVELS for row in _level(results, level)),
        *(row for count, data in crowds.items() for row in rows_of_crowd(count, data)),
        *(row for beams in APART for row in rows_of_pair(results, beams)),
    ]
    return beside(PRINTED["kreucher2011"], ours)


def _whole(name: str, data: xr.Dataset) -> list[Row]:
    tracks, how = tracks_of(data), WHOLE[name]
    first = np.array([run.first() for run in tracks])
    joint = (data.joint.values & (data.label.values > 0)).any(axis=2)[:, runs.FROM :].sum(axis=1)
    key = "" if name == "synthetic" else f"{name}_"
    last = "scan in which the last target is {}, median" + how
    return [
        mean(f"{key}declared_mean", f"targets that get a track{how}", "1", np.isfinite(first).sum(axis=1)),
        mean(f"{key}false_tracks_mean", f"false tracks{how}", "1", [run.false() for run in tracks]),
        _median(f"{key}declaration_scan_last", last.format("declared"), first.max(axis=1)),
        _median(f"{key}handover_scan_last", last.format("handed over"), handed_over(data)),
        *(
            _share(f"{key}{what}_in_close_pass_whole", f"{what} in the close pass, whole tracker{how}", runs_so)
            for what, runs_so in before_and_after(tracks, runs.FROM).items()
        ),
        *_distances(key, how, tracks),
        mean(f"{key}joint_scans", f"scans of joint updates from scan {runs.FROM} on{how}", "scan", joint),
        _off(f"{key}rmse_triangulated_m", f"error, bearings tracked, then intersected{how}", data, "tracked"),
        _off(f"{key}rmse_true_beams_m", f"error, true beams intersected{how}", data, "exact"),
    ]


def _off(key: str, name: str, data: xr.Dataset, kind: str) -> Row:
    """Error of places that are intersected."""
    off = data[kind].values - np.stack([data.true_x.values, data.true_y.values], axis=-1)
    return _root(key, name, (off[:, SETTLED - 1 :] ** 2).sum(axis=-1).mean(axis=(1, 2)))


def _level(results: Results, level: float) -> list[Row]:
    ours, louder, key = [], f"beams of level {level:g}", f"level_{level:g}"
    data = finished(results, key)
    if data is not None:
        tracks = tracks_of(data)
        first = np.array([run.first() for run in tracks])
        by_scan = f"targets with a track by scan {data.sizes['scan']}, {louder}"
        last = f"scan in which the last target is handed over, median of the runs that declare three, {louder}"
        declared = (data.label.values[:, SETTLED - 1] > 0).sum(axis=1) == len(scene.STARTS)
        ours += [
            mean(f"{key}_declared", by_scan, "1", np.isfinite(first).sum(axis=1)),
            mean(f"{key}_false", f"false tracks, {louder}", "1", [run.false() for run in tracks]),
            _median(f"{key}_declaration_scan", f"scan of a target's declaration, median, {louder}", first),
            _median(f"{key}_handover_scan_last", last, handed_over(data)[declared]),
        ]
    for name, how in (("", ""), ("_separate", ", never updated jointly")):
        data = finished(results, f"close_{level:g}{name}")
        passed = {} if data is None else before_and_after(tracks_of(data), 1)
        for what, runs_so in passed.items():
            plain = ("swaps" if what == "swapped" else f"{what}_in_close_pass") + name
            this = plain if level == scene.LEVEL else f"{key}_{plain}"
            ours.append(_share(this, f"{what} in the close pass, {louder}{how}", runs_so))
    return ours


def rows_of_crowd(count: int, data: xr.Dataset) -> list[Row]:
    """Of so many targets at once: those found, false tracks, GOSPA."""
    tracks, targets, key = tracks_of(data), f"{count} targets", f"crowd_{count}"
    last = [run.at_the_end() for run in tracks]
    pairs = np.array([(scan.pairs >= 0).all(axis=1).sum() for scan in last])
    false = np.array([(scan.pairs[:, 1] < 0).sum() for scan in last])
    ours = [
        mean(f"{key}_found", f"{targets}: those with a track at scan {scene.CROWD_SCANS}", "1", pairs),
        mean(f"{key}_false", f"{targets}: tracks of none at scan {scene.CROWD_SCANS}", "1", false),
        *_distances(f"{key}_", f", {targets}", tracks, errors=False),
    ]
    if count == 2:
        stay = np.array([ghosts_stay(run.true) for run in tracks])
        where = f"both ghosts stay in the region for {SETTLED} scans, no faster than targets"
        ours.append(_share(f"{key}_ghosts", f"{targets}: runs in which {where}", stay))
        for name, which, runs_so in (("ghosts", stay, f"where {where}"), ("clear", ~stay, "in the other runs")):
            ours.append(mean(f"{key}_found_{name}", f"{targets}: found {runs_so}", "1", pairs[which]))
            ours.append(mean(f"{key}_false_{name}", f"{targets}: tracks of none {runs_so}", "1", false[which]))
    return ours


def rows_of_pair(results: Results, beams: float) -> list[Row]:
    """Of two targets side by side, so many beams apart."""
    ours, targets = [], f"two targets side by side, {beams:g} beams apart"
    for name, what in (
        ("found", "both have a track at the end, one detector"),
        ("kept", "both are held to the end from a start near them"),
        ("kept_separate", "the same, never updated jointly"),
    ):
        start, *separate = name.split("_")
        data = finished(results, "_".join([start, f"{beams:g}", *separate]))
        if data is None:
            continue
        tracks = tracks_of(data)
        last = [run.at_the_end().pairs for run in tracks]
        both = np.array([len(pairs) == 2 and bool((pairs >= 0).all()) for pairs in last])
        ours.append(_share(f"apart_{beams:g}_{name}", f"{targets}: {what}", both))
        if name != "found":
            ours += _distances(f"apart_{beams:g}_{name}_", f", {targets}, {what}", tracks, errors=False)
    return ours


def _distances(key: str, how: str, tracks: Sequence[Tracks], errors: bool = True) -> list[Row]:
    """GOSPA, and errors where they are asked for."""
    total, squares, pairs = np.moveaxis(np.array([run.distances() for run in tracks]), 2, 0)
    ours = [mean(f"{key}gospa", f"GOSPA, cutoff {CUTOFF:g} m{how}", "m", total.mean(axis=1))]
    if errors:
        count = pairs.sum(axis=1)
        each_run = squares.sum(axis=1)[count > 0] / count[count > 0]
        ours.insert(0, _root(f"{key}rmse_m", f"error of tracks{how}", each_run))
    return ours


def _median(key: str, name: str, scans: np.ndarray) -> Row:
    return bootstrapped(key, name, "scan", np.median, scans)


def _root(key: str, name: str, squares: np.ndarray) -> Row:
    return bootstrapped(key, name, "m", lambda squares: np.sqrt(squares.mean()), squares)


def _share(key: str, name: str, runs_so: np.ndarray) -> Row:
    return share(key, name, int(runs_so.sum()), len(runs_so))
