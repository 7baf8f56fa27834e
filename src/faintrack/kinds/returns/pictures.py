"""Returns of an active sonar with their tracks: maps of position and velocity, existence, number of returns."""

import numpy as np
import xarray as xr
from jax import numpy as jnp
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from faintrack.kinds.returns.build import expected_returns, sonar_axes
from faintrack.kinds.returns.pairs import pairs_of_result
from faintrack.kinds.returns.sections import SonarSection
from faintrack.results.pictures import GREY, LINE, TRACK, draw_existence, ends
from faintrack.results.result import Result
from faintrack.results.track import tracks_of
from faintrack.sensors.bistatic import Bistatic, fixed

ACROSS = 4
"""Maps side by side."""

FAINTEST = 1e-6, 1e-3
"""Probabilities at the lower end of the colours: of a cell of position, of a cell of velocity."""

KM = 1e-3


def draw(result: Result) -> Figure:
    """Figure of a result of returns: maps of position and velocity after some pings, existence, number of returns.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    data = result.data
    bands = -(-data.sizes["snapshot"] // ACROSS)
    shape = [float(np.ptp(ends(data[name].values))) for name in ("axis_x", "axis_y")]
    heights = [min(2.6 * shape[1] / shape[0], 5.0), 1.6] * bands + [1.5, 1.2]
    figure = Figure(figsize=(11, sum(heights) + 1.2), layout="constrained")
    rows = figure.add_gridspec(len(heights), ACROSS, height_ratios=heights)
    for band in range(bands):
        numbers = range(band * ACROSS, min((band + 1) * ACROSS, data.sizes["snapshot"]))
        maps = [figure.add_subplot(rows[2 * band, column]) for column in range(len(numbers))]
        velocities = [figure.add_subplot(rows[2 * band + 1, column]) for column in range(len(numbers))]
        for place, velocity, number in zip(maps, velocities, numbers, strict=True):
            draw_map(place, result, number)
            draw_velocity(velocity, data, number)
        maps[0].set_ylabel("north (km)", fontsize=8)
        velocities[0].set_ylabel("to the north (m/s)", fontsize=8)
        for panels, label in (
            (maps, "probability of a target\nin the cell"),
            (velocities, "of a velocity, if\nthere is a target"),
        ):
            bar = figure.colorbar(panels[0].images[0], ax=panels, pad=0.01)
            bar.set_label(label, fontsize=8)
            bar.ax.tick_params(labelsize=7)
    figure.legend(handles=_legend(), loc="outside upper center", ncols=6, fontsize=8, frameon=False)
    existence = figure.add_subplot(rows[-2, :])
    returns = figure.add_subplot(rows[-1, :], sharex=existence)
    draw_existence(existence, result)
    existence.plot(data.snapshot, np.full(data.sizes["snapshot"], -0.02), "^", color=GREY, markersize=5, clip_on=False)
    draw_counts(returns, result)
    returns.set_xlabel("time from the first ping (s); the triangles mark the maps")
    return figure


def draw_map(axes: Axes, result: Result, number: int) -> None:
    """What is believed of the position after a ping, with source, receiver, what they hear, and the track so far."""
    data = result.data
    shot = data.isel(snapshot=number)
    time = float(shot.snapshot)
    now = data.isel(time=int(np.argmin(np.abs(data.time.values - time))), slot=0)
    chance = float(now.existence) * np.exp(shot.position.values.T.astype(float))
    x, y = (ends(KM * data[name].values) for name in ("axis_x", "axis_y"))
    axes.imshow(
        np.maximum(chance, FAINTEST[0]),
        origin="lower",
        extent=(*x, *y),
        cmap="cividis",
        norm=LogNorm(FAINTEST[0], 1),
        interpolation="nearest",
    )
    for pair in pairs_of_result(result):
        here = now if "pair" not in now.coords else now.sel(pair=pair.name)
        for delay, style in zip(_limits(pair.table), ("-", "--"), strict=True):
            axes.plot(*_ellipse(pair.table, here, delay), style, color="white", linewidth=0.8)
        for platform, marker in (("source", "^"), ("receiver", "s")):
            place = KM * float(here[f"{platform}_x"]), KM * float(here[f"{platform}_y"])
            axes.plot(*place, marker, color="white", markeredgecolor="black", markersize=5, linestyle="none")
    for track in tracks_of(data.sel(time=data.time <= time)):
        axes.plot(KM * track.mean["x"], KM * track.mean["y"], color=TRACK, linewidth=1.2)
        if track.label == int(now.label):
            axes.plot(KM * now.x, KM * now.y, "o", markersize=11, markerfacecolor="none", color=TRACK)
    axes.set_xlim(x)
    axes.set_ylim(y)
    axes.set_title(f"{time:.5g} s, existence {float(now.existence):.3f}", fontsize=9, pad=3)
    axes.set_xlabel("east (km)", fontsize=8, labelpad=1)
    axes.tick_params(labelsize=7)


def draw_velocity(axes: Axes, data: xr.Dataset, number: int) -> None:
    """What is believed of the velocity after a ping, if there is a target; the mean as a cross."""
    shot = data.isel(snapshot=number)
    now = data.sel(time=float(shot.snapshot), method="nearest").isel(slot=0)
    axes.imshow(
        np.maximum(np.exp(shot.velocity.values.T.astype(float)), FAINTEST[1]),
        origin="lower",
        extent=(*ends(data.axis_vx.values), *ends(data.axis_vy.values)),
        cmap="cividis",
        norm=LogNorm(FAINTEST[1], 1),
        interpolation="nearest",
    )
    axes.plot(now.vx, now.vy, "+", color=TRACK, markersize=8, markeredgewidth=1.6)
    axes.set_xlabel("to the east (m/s)", fontsize=8, labelpad=1)
    axes.tick_params(labelsize=7)


def draw_counts(axes: Axes, result: Result) -> None:
    """Number of returns of every ping, and how many noise alone gives on average."""
    data = result.data
    axes.plot(data.time, data.returns, color=LINE, linewidth=1.0, drawstyle="steps-mid")
    expected = sum(expected_returns(pair.table) for pair in pairs_of_result(result))
    axes.axhline(expected, color=GREY, linestyle="--", linewidth=0.8)
    axes.text(
        0.005, 0.87, f"dashed: {expected:.3g} expected of noise alone", transform=axes.transAxes, fontsize=8, color=GREY
    )
    axes.set_ylim(0, 1.3 * max(expected, float(data.returns.max()), 1))
    axes.set_ylabel("returns")
    axes.grid(alpha=0.3)


def _legend() -> list[Line2D]:
    def mark(marker: str, label: str) -> Line2D:
        return Line2D([], [], color="white", marker=marker, markeredgecolor="black", linestyle="none", label=label)

    return [
        mark("^", "source"),
        mark("s", "receiver"),
        Line2D([], [], color=GREY, label="blanked inside"),
        Line2D([], [], color=GREY, linestyle="--", label="not heard outside"),
        Line2D([], [], color=TRACK, marker="o", markersize=9, markerfacecolor="none", label="track, mean position"),
        Line2D([], [], color=TRACK, marker="+", markersize=8, linestyle="none", label="mean velocity"),
    ]


def _limits(sonar: SonarSection) -> tuple[float, float]:
    """Delays at which a sonar begins and ceases to hear; s."""
    delay, _ = sonar_axes(sonar)
    return float(delay.edges[0]), float(delay.edges[-1])


def _ellipse(sonar: SonarSection, now: xr.Dataset, delay: float) -> tuple[np.ndarray, np.ndarray]:
    """Places in km whose echoes arrive after a delay, during one ping of one source and one receiver."""
    source, receiver = (fixed(float(now[f"{name}_x"]), float(now[f"{name}_y"])) for name in ("source", "receiver"))
    pair = Bistatic(source, receiver, sonar.sound_speed)
    x, y = pair.position(jnp.asarray(delay), jnp.linspace(0, 2 * jnp.pi, 361))
    return KM * np.asarray(x), KM * np.asarray(y)
