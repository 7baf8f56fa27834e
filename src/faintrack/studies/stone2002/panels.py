"""The paper's figures, drawn from the runs."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float
from matplotlib.axes import Axes

from faintrack.likelihoods.contacts import BearingContact, Contact, RangeDetection, Together, convergence_zones
from faintrack.studies.panels import BLUE, VERMILION, Panel, mosaic
from faintrack.studies.printed import PRINTED
from faintrack.studies.stone2002 import periscope, simulation, tenet
from faintrack.studies.stone2002.settings import periscope_name
from faintrack.studies.study import Results, finished, ran
from faintrack.targets.states import PlanarState

TRUTH = VERMILION
"""Colour of what is true."""

SENSOR, BEARING_DEG, BEARING_ERROR_DEG = (70.0, 0.0), 135.0, 15.0
"""Section 2.4: place of the sensor, the bearing measured and its standard deviation."""


def figures(results: Results, folder: Path) -> list[Path]:
    """Figures of the paper by its numbers; those of settings that have not run are left out."""
    drawn = [mosaic(folder / "figure_1_to_3.png", _contacts(), columns=3)]
    for name, setting, panels, columns in (
        ("figure_4_to_7", "surfaces", _surfaces, 2),
        ("figure_8_and_9", "profiles", _profiles, 2),
        ("figure_10", "profiles", _expanded, 2),
        ("figure_11_to_20", "tenet_points", _points, 5),
    ):
        data = finished(results, setting)
        if data is not None:
            drawn.append(mosaic(folder / f"{name}.png", panels(data.isel(run=0)), columns))
    by_scr = ran(results, {scr_db: periscope_name(scr_db) for scr_db in periscope.SCR_DB})
    if by_scr:
        drawn.append(mosaic(folder / "periscope.png", [("", {}, lambda axis: _by_scr(axis, by_scr))], columns=1))
    return drawn


def _contacts() -> list[Panel]:
    """A detection by a sensor with convergence zones, a bearing, and both (section 2.4)."""
    place = jnp.linspace(0.0, 100.0, 201)
    still = jnp.zeros(())
    states = PlanarState(place[None, :], place[:, None], still, still)
    detection = RangeDetection(SENSOR, convergence_zones(30.0, 4.0), 0.01)
    bearing = BearingContact(SENSOR, math.radians(BEARING_ERROR_DEG))
    contacts = Contact(still, jnp.array(True)), Contact(still, jnp.array(math.radians(BEARING_DEG)))

    def panel(title: str, log_ratio: Array) -> Panel:
        def draw(axis: Axes) -> None:
            shown = axis.imshow(np.exp(np.asarray(log_ratio)), origin="lower", extent=(0, 100, 0, 100))
            axis.plot(*SENSOR, "w^", clip_on=False)
            axis.figure.colorbar(shown, ax=axis, shrink=0.7, label="likelihood ratio")

        return title, {}, draw

    return [
        panel("1: detection", detection.log_ratio(contacts[0], states)),
        panel("2: bearing", bearing.log_ratio(contacts[1], states)),
        panel("3: both", Together((detection, bearing)).log_ratio(contacts, states)),
    ]


def _surfaces(run: xr.Dataset) -> list[Panel]:
    """Log target likelihood ratio over position and velocity; the marker is over the target."""
    surface = run.surface.values
    cells = np.arange(1, simulation.CELLS + 1)
    position, velocity = np.meshgrid(cells, simulation.VELOCITIES.values, indexing="ij")

    def panel(number: int, time: int) -> Panel:
        height = np.where(np.isfinite(surface[time]), surface[time], np.nan)

        def draw(axis: Any) -> None:
            axis.plot_surface(position, velocity, height, cmap="viridis", rstride=1, cstride=1, lw=0)
            truth = simulation.START + simulation.VELOCITY * time
            axis.scatter([truth], [simulation.VELOCITY], [np.nanmax(height) + 5], marker="v", color=TRUTH)
            axis.set(xlabel="position (cell)", ylabel="velocity (cells a scan)", zlabel="log ratio")
            axis.view_init(30, -65)
            axis.set_box_aspect(None, zoom=0.82)

        return f"{number}: t = {time}", {"projection": "3d"}, draw

    return [panel(number, time) for number, time in ((4, 0), (5, 5), (6, 10), (7, 15))]


def _profiles(run: xr.Dataset) -> list[Panel]:
    """Power of the radar, and likelihood ratio of every range, scan by scan downward."""
    end = (0, periscope.RANGES, periscope.SCANS * periscope.INTERVAL, 0)

    def picture(values: Float[np.ndarray, "scan range"], label: str, low: float) -> Callable[[Axes], None]:
        def draw(axis: Axes) -> None:
            shown = axis.imshow(values, extent=end, aspect="auto", vmin=low, cmap="viridis")
            axis.set(xlabel="range (ft)", ylabel="time (s)")
            axis.figure.colorbar(shown, ax=axis, label=label)

        return draw

    return [
        ("8: radar", {}, picture(10 * np.log10(run.power.values), "power (dB)", -20.0)),
        ("9: tracker", {}, picture(run.over_range.values / math.log(10), "log10 likelihood ratio", -6.0)),
    ]


def _expanded(run: xr.Dataset) -> list[Panel]:
    """The likelihood ratio around the target's path, and that of every range rate."""
    time = periscope.INTERVAL * np.arange(periscope.SCANS)
    path = run.path.values

    def near(axis: Axes) -> None:
        middle = path[(time >= periscope.EXPOSED) & (time < periscope.SUBMERGED)]
        low, high = max(int(middle.min()) - 20, 0), int(middle.max()) + 20
        values = run.over_range.values[:, low:high] / math.log(10)
        axis.imshow(values, extent=(low, high, time[-1], 0), aspect="auto", vmin=-4, cmap="Greys")
        for edge in (periscope.EXPOSED, periscope.SUBMERGED):
            axis.axhline(edge, color=TRUTH, lw=0.8)
        axis.set(xlabel="range (ft)", ylabel="time (s)", ylim=(periscope.SUBMERGED + 5, periscope.EXPOSED - 2))

    def rate(axis: Axes) -> None:
        edges = periscope.RATES.edges[[0, -1]] * periscope.FOOT
        values = run.over_rate.values / math.log(10)
        axis.imshow(values, extent=(*edges, time[-1], 0), aspect="auto", vmin=-4, cmap="Greys")
        axis.axvline(float(run.rate) * periscope.FOOT, color=TRUTH, lw=0.8, ls=":")
        axis.set(xlabel="range rate (m/s)", ylabel="time (s)")

    return [("10: near the target", {}, near), ("10: range rates", {}, rate)]


def _points(run: xr.Dataset) -> list[Panel]:
    """Log likelihood ratio of pixels above, of velocities below, at t = 0, 2, 4, 6, 8."""
    ratio, truth = np.exp(run.log_ratio.values.astype(float)), run.truth.values

    def panel(number: int, time: int, at: int, edges: tuple[Any, Any], labels: tuple[str, str]) -> Panel:
        first, second = run.state.values[time, at], run.state.values[time, at + 1]
        summed, _, _ = np.histogram2d(first, second, edges, weights=ratio[time])
        with np.errstate(divide="ignore"):
            shown = np.log(summed.T)

        def draw(axis: Axes) -> None:
            mesh = axis.pcolormesh(*edges, np.where(np.isfinite(shown), shown, np.nan), cmap="viridis")
            axis.plot(truth[time, at], truth[time, at + 1], "*", color=TRUTH, ms=9)
            axis.set(xlabel=labels[0], ylabel=labels[1], aspect="equal")
            axis.figure.colorbar(mesh, ax=axis, shrink=0.7)

        return f"{number}: t = {2 * time}", {}, draw

    half = tenet.PIXEL / 2
    pixels = np.arange(-1.5 - half, 4.5 + tenet.PIXEL, tenet.PIXEL), np.arange(-3 - half, 3 + tenet.PIXEL, tenet.PIXEL)
    speeds = np.linspace(-0.6, 0.8, 57), np.linspace(-0.7, 0.7, 57)
    return [
        *(panel(11 + 2 * time, time, 0, pixels, ("x", "y")) for time in range(5)),
        *(panel(12 + 2 * time, time, 2, speeds, ("x velocity", "y velocity")) for time in range(5)),
    ]


def _by_scr(axis: Axes, by_scr: dict[int, xr.Dataset]) -> None:
    """How the periscope's peak moves with its strength."""
    printed = PRINTED["stone2002"]["periscope_log10_peak"]
    quantiles = np.array([np.quantile(data.peak, [0.16, 0.5, 0.84]) for data in by_scr.values()]) / math.log(10)
    axis.fill_between(list(by_scr), quantiles[:, 0], quantiles[:, 2], color=BLUE, alpha=0.2, lw=0)
    axis.plot(list(by_scr), quantiles[:, 1], color=BLUE, marker="o", ms=4)
    axis.axhline(printed, color="0.7", lw=0.8)
    axis.annotate("paper", (max(by_scr), printed), ha="right", va="bottom", color="0.4")
    axis.set(xlabel="target over clutter (dB)", ylabel="log10 of the highest likelihood ratio")
