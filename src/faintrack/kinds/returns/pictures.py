"""Returns of an active sonar with their tracks: maps of position and velocity, existence, number of returns."""

import numpy as np
import xarray as xr
from faintrack.plots.bearing import GREY, LINE, TRACK, draw_existence, each_track
from faintrack.plots.frames import ends
from faintrack.scenario.build_returns import expected_returns, sonar_axes
from faintrack.scenario.sonar import SonarTable
from jax import numpy as jnp
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from faintrack.results.result import Result
from faintrack.sensors.bistatic import Bistatic, fixed

ACROSS = 4
"""Maps side by side."""

FAINTEST = 1e-6, 1e-3
"""Probabilities at the lower end of the colours: of a cell of position, of a cell of velocity."""

KM = 1e-3


def draw_returns(result: Result) -> Figure:
    """Figure of a result of returns: maps of position and velocity after some pings, existence, number of returns.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    data = result.data
    bands = -(-data.sizes["snapshot"] // ACROSS)
    shape = [float(np.ptp(ends(data[name].values))) for name in ("x", "y")]
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
    now = data.isel(time=int(np.argmin(np.abs(data.time.values - time))))
    chance = float(now.existence) * np.exp(shot.position.values.T.astype(float))
    x, y = (ends(KM * data[name].values) for name in ("x", "y"))
    axes.imshow(
        np.maximum(chance, FAINTEST[0]),
        origin="lower",
        extent=(*x, *y),
        cmap="cividis",
        norm=LogNorm(FAINTEST[0], 1),
        interpolation="nearest",
    )
    for delay, style in zip(_heard(result), ("-", "--"), strict=True):
        axes.plot(*_ellipse(result, now, delay), style, color="white", linewidth=0.8)
    for platform, marker in (("source", "^"), ("receiver", "s")):
        place = KM * float(now[f"{platform}_x"]), KM * float(now[f"{platform}_y"])
        axes.plot(*place, marker, color="white", markeredgecolor="black", markersize=5, linestyle="none")
    for label, mine in each_track(data.sel(time=data.time <= time)):
        axes.plot(KM * mine.x_mean, KM * mine.y_mean, color=TRACK, linewidth=1.2)
        if label == int(now.label):
            axes.plot(KM * now.x_mean, KM * now.y_mean, "o", markersize=11, markerfacecolor="none", color=TRACK)
    axes.set_xlim(x)
    axes.set_ylim(y)
    axes.set_title(f"{time:.5g} s, existence {float(now.existence):.3f}", fontsize=9, pad=3)
    axes.set_xlabel("east (km)", fontsize=8, labelpad=1)
    axes.tick_params(labelsize=7)


def draw_velocity(axes: Axes, data: xr.Dataset, number: int) -> None:
    """What is believed of the velocity after a ping, if there is a target; the mean as a cross."""
    shot = data.isel(snapshot=number)
    now = data.sel(time=float(shot.snapshot), method="nearest")
    axes.imshow(
        np.maximum(np.exp(shot.velocity.values.T.astype(float)), FAINTEST[1]),
        origin="lower",
        extent=(*ends(data.vx.values), *ends(data.vy.values)),
        cmap="cividis",
        norm=LogNorm(FAINTEST[1], 1),
        interpolation="nearest",
    )
    axes.plot(now.vx_mean, now.vy_mean, "+", color=TRACK, markersize=8, markeredgewidth=1.6)
    axes.set_xlabel("to the east (m/s)", fontsize=8, labelpad=1)
    axes.tick_params(labelsize=7)


def draw_counts(axes: Axes, result: Result) -> None:
    """Number of returns of every ping, and how many noise alone gives on average."""
    data = result.data
    axes.plot(data.time, data.returns, color=LINE, linewidth=1.0, drawstyle="steps-mid")
    expected = expected_returns(_sonar(result))
    axes.axhline(expected, color=GREY, linestyle="--", linewidth=0.8)
    told = f"dashed: {expected:.3g} expected of noise alone"
    axes.text(0.005, 0.87, told, transform=axes.transAxes, fontsize=8, color=GREY)
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


def _sonar(result: Result) -> SonarTable:
    table = result.scenario.sonar
    assert table is not None, "returns have a sonar"
    return table


def _heard(result: Result) -> tuple[float, float]:
    """Delays at which the sonar begins and ceases to hear; s."""
    delay, _ = sonar_axes(_sonar(result))
    return float(delay.edges[0]), float(delay.edges[-1])


def _ellipse(result: Result, now: xr.Dataset, delay: float) -> tuple[np.ndarray, np.ndarray]:
    """Places in km whose echoes arrive after a delay, during one ping."""
    source, receiver = (fixed(float(now[f"{name}_x"]), float(now[f"{name}_y"])) for name in ("source", "receiver"))
    pair = Bistatic(source, receiver, _sonar(result).sound_speed)
    x, y = pair.position(jnp.asarray(delay), jnp.linspace(0, 2 * jnp.pi, 361))
    return KM * np.asarray(x), KM * np.asarray(y)
