"""The paper's figures 1 to 7, and how results move with the level of targets and their number, drawn from the runs."""

import functools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from faintrack.studies.kreucher2011 import runs, scene
from faintrack.studies.kreucher2011.rows import rows_of_crowd, rows_of_pair
from faintrack.studies.kreucher2011.settings import APART, COUNTS
from faintrack.studies.kreucher2011.tracks import Tracks, before_and_after, tracks_of
from faintrack.studies.panels import BLACK, COLOURS, Panel, draw_rows, finish, mosaic
from faintrack.studies.study import Results, address, finished, ran
from faintrack.targets.states import PlanarState

GREY = "#777777"
"""Of what is fixed."""

THRESHOLD = 0.9
"""Probability at which a detector hands over."""

SMALL = {"fontsize": 7}


def figures(results: Results, folder: Path) -> list[Path]:
    """Figures of the paper by its numbers; those of settings that have not run are left out."""
    drawn = []
    for name, setting, panels, columns in (
        ("figure_1_and_2", "four", _four, 3),
        ("figure_3_to_7", "synthetic", _synthetic, 2),
    ):
        data = finished(results, setting)
        if data is not None:
            drawn.append(mosaic(folder / f"{name}.png", panels(data.isel(run=0)), columns))
    beyond = [panel for part in (_levels, _crowds, _side_by_side) for panel in part(results)]
    if beyond:
        drawn.append(mosaic(folder / "beyond.png", beyond, min(len(beyond), 3)))
    return drawn


def _four(data: xr.Dataset) -> list[Panel]:
    """Four targets in one detector: what it believes of the position, and its probability."""
    detection = data.detection.values[:, 0]
    handed = np.flatnonzero(_starts(data))
    moments = np.unique([handed[0], *(handed[:3] + 1), handed[-1] + 2])

    def statistic(axis: Axes) -> None:
        axis.plot(np.arange(1, len(detection) + 1), detection, color=COLOURS[0], linewidth=1.4)
        axis.axhline(THRESHOLD, color=GREY, linestyle="--", linewidth=0.8)
        axis.plot(handed + 1, detection[handed], "v", color=COLOURS[1], label="handed over")
        finish(axis, {"loc": "lower right"}, xlabel="scan", ylabel="target-present probability", ylim=(0, 1.05))

    return [
        *((f"1: after scan {scan + 1}", {}, functools.partial(_belief, data=data, scan=int(scan))) for scan in moments),
        ("2: detection statistic", {}, statistic),
    ]


def _starts(data: xr.Dataset) -> np.ndarray:
    """Whether a target was handed over, scan by scan."""
    held = data.existence.values > 0
    return np.append((held[1:] & ~held[:-1]).any(axis=1), False)


def _belief(axis: Axes, data: xr.Dataset, scan: int) -> None:
    east, north = scene.BOX
    picture = axis.imshow(
        data.log_place.values[scan].T / np.log(10),
        origin="lower",
        extent=(*east, *north),
        cmap="cividis",
        vmin=-6,
        vmax=0,
    )
    # Cells without any probability, as after a hand-over, have no logarithm.
    axis.set_facecolor(picture.cmap(0))
    axis.figure.colorbar(picture, ax=axis, shrink=0.8).set_label("log10 probability in a cell", fontsize=7)
    axis.plot(data.true_x[scan], data.true_y[scan], "+", color="white", markersize=8, label="target")
    held = data.existence.values[scan] > 0
    axis.plot(
        data.x.values[scan, held],
        data.y.values[scan, held],
        "o",
        color=COLOURS[1],
        markersize=9,
        mfc="none",
        label="handed over before",
    )
    axis.set(xlabel="east (m)", ylabel="north (m)")
    axis.legend(fontsize=6, loc="lower left")


def _synthetic(data: xr.Dataset) -> list[Panel]:
    """The first run: region, records, tracks, and tracks on the records."""
    (tracks,) = tracks_of(data.expand_dims("run"))
    _, scans, _ = jax.jit(runs.drawn)(address(0, "synthetic", 0), scene.LEVEL)
    energy = np.asarray(scans.energy)
    stations = jax.tree.map(lambda values: values[0], scans.stations)
    x, y = jnp.asarray(tracks.place.transpose(2, 0, 1), jnp.float32)
    still = jnp.zeros_like(x)
    bearing = np.degrees(scene.FANS.bearings(stations, PlanarState(x, y, still, still)))

    def record(axis: Axes, array: int, over: bool) -> None:
        picture = axis.imshow(
            energy[:, array],
            aspect="auto",
            origin="lower",
            cmap="Greys",
            vmin=-1,
            vmax=5,
            extent=(-0.5, 179.5, 0.5, len(energy) + 0.5),
            interpolation="nearest",
        )
        axis.figure.colorbar(picture, ax=axis).set_label("energy (noise std)", fontsize=7)
        if over:
            for label, scan, slot in _labelled(tracks):
                axis.plot(bearing[array, scan, slot], scan + 1, color=_colour(label), linewidth=1.2)
        axis.set(xlabel="bearing from the array's axis (degrees)", ylabel="scan (1 s)", xlim=(15, 115))

    def region(axis: Axes, tracked: bool) -> None:
        _draw_region(axis)
        _draw_truth(axis, tracks)
        if tracked:
            _draw_tracks(axis, tracks)

    def close(axis: Axes) -> None:
        _draw_truth(axis, tracks)
        _draw_tracks(axis, tracks)
        finish(axis, xlabel="east (m)", ylabel="north (m)", aspect="equal")

    return [
        ("3: region, detectors and arrays", {}, functools.partial(region, tracked=False)),
        ("5: estimates (every tenth) and truth (dashed)", {}, close),
        *(
            (f"4: record of the array at {x} m", {}, functools.partial(record, array=array, over=False))
            for array, x in enumerate((0, 700))
        ),
        ("6: estimates within the region", {}, functools.partial(region, tracked=True)),
        ("detection statistic of the 16 detectors", {}, functools.partial(_statistics, data=data)),
        *(
            (f"7: tracks on the record of the array at {x} m", {}, functools.partial(record, array=array, over=True))
            for array, x in enumerate((0, 700))
        ),
    ]


def _statistics(axis: Axes, data: xr.Dataset) -> None:
    detection = data.detection.values
    axis.plot(np.arange(1, len(detection) + 1), detection, linewidth=0.8)
    axis.axhline(THRESHOLD, color=GREY, linestyle="--", linewidth=0.8)
    finish(axis, xlabel="scan (1 s)", ylabel="target-present probability", ylim=(0, 1.05))


def _labelled(tracks: Tracks) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Label, scans and slots of each track."""
    labels = np.unique(tracks.label[tracks.label > 0])
    where = ((int(label), np.nonzero(tracks.label == label)) for label in labels)
    return [(label, scan, slot) for label, (scan, slot) in where]


def _colour(label: int) -> str:
    return COLOURS[(label - 1) % len(COLOURS)]


def _draw_region(axis: Axes) -> None:
    east, north = scene.REGION
    place = scene.tracker(speed=scene.COARSE).detectors.place
    side = scene.CELL * scene.CELLS[0]
    for x, y in zip(np.asarray(place.x), np.asarray(place.y), strict=True):
        axis.add_patch(Rectangle((x, y), side, side, fill=False, color=COLOURS[5], linewidth=0.7))
    axis.add_patch(Rectangle((east[0], north[0]), east[1] - east[0], north[1] - north[0], fill=False, color=GREY))
    stations = scene.stations()
    axis.plot(np.asarray(stations.x), np.asarray(stations.y), "s", color=GREY, markersize=6)
    axis.set(xlabel="east (m)", ylabel="north (m)", aspect="equal", xlim=(-60, 1560), ylim=(-60, 1760))


def _draw_truth(axis: Axes, tracks: Tracks) -> None:
    for target in tracks.true.transpose(1, 0, 2):
        axis.plot(*target.T, "--", color=BLACK, linewidth=0.8)
        axis.plot(*target[0], ".", color=BLACK, markersize=5)


def _draw_tracks(axis: Axes, tracks: Tracks) -> None:
    for label, scan, slot in _labelled(tracks):
        place = tracks.place[scan, slot][::10]
        axis.plot(*place.T, "o", mfc="none", color=_colour(label), markersize=5)


def _levels(results: Results) -> list[Panel]:
    """Targets with a track against the scan, and what comes of a close pass, for every level."""
    declaring = ran(results, {level: f"level_{level:g}" for level in scene.LEVELS})
    first = {level: [run.first() for run in tracks_of(data)] for level, data in declaring.items()}

    def curves(axis: Axes) -> None:
        at = np.arange(1, runs.FROM)
        for (level, scans), colour in zip(first.items(), COLOURS, strict=False):
            share = (np.array(scans)[..., None] <= at).mean(axis=(0, 1))
            axis.plot(at, share, color=colour, label=f"level {level:g}, {len(scans)} runs")
        finish(axis, SMALL, xlabel="scan (1 s)", ylabel="share of targets with a track", xlim=(0, 60), ylim=(0, 1.02))

    def passes(axis: Axes) -> None:
        for style, name, how in (("-o", "", "jointly"), ("--x", "_separate", "separately")):
            close = ran(results, {level: f"close_{level:g}{name}" for level in scene.LEVELS})
            ends = {level: before_and_after(tracks_of(data), 1) for level, data in close.items()}
            for what, colour in zip(("lost", "merged", "swapped"), COLOURS, strict=False):
                shares = [runs_so[what].mean() for runs_so in ends.values()]
                axis.plot(list(ends), shares, style, color=colour, label=f"{what}, {how}", ms=4)
        finish(axis, SMALL, xlabel="level of a target (noise std)", ylabel="share of close passes", ylim=(0, None))

    panels: list[Panel] = [("declarations", {}, curves)] if first else []
    if finished(results, f"close_{scene.LEVEL:g}") is not None:
        panels.append(("close pass", {}, passes))
    return panels


def _crowds(results: Results) -> list[Panel]:
    """Tracks of targets, and of none, against the number of targets."""
    crowds = ran(results, {count: f"crowd_{count}" for count in COUNTS})
    rows = {count: rows_of_crowd(count, data)[:2] for count, data in crowds.items()}

    def draw(axis: Axes) -> None:
        axis.plot([0, scene.CROWD], [0, scene.CROWD], color=GREY, linewidth=0.8, label="all")
        for what, colour, of_counts in zip(
            ("with a track", "tracks of none"), COLOURS, zip(*rows.values(), strict=True), strict=False
        ):
            draw_rows(axis, list(rows), of_counts, colour, what)
        finish(axis, SMALL, xlabel="targets", ylabel=f"mean number at scan {scene.CROWD_SCANS}")

    return [("number of targets", {}, draw)] if rows else []


def _side_by_side(results: Results) -> list[Panel]:
    """Share of runs in which both of two targets side by side are found, or held."""
    rows = {beams: {row.key.split("_", 2)[2]: row for row in rows_of_pair(results, beams)} for beams in APART}
    curves = {"found": "both found", "kept": "both held, jointly", "kept_separate": "both held, separately"}

    def draw(axis: Axes) -> None:
        for (name, what), colour in zip(curves.items(), COLOURS, strict=False):
            curve = {beams: of_pair[name] for beams, of_pair in rows.items() if name in of_pair}
            draw_rows(axis, list(curve), list(curve.values()), colour, what)
        finish(axis, SMALL, xlabel="beams apart", ylabel="share of runs", ylim=(0, 1.05))

    return [("two targets side by side", {}, draw)] if any(rows.values()) else []
