"""From the sections of a scenario to what tracks in the returns of a sonar: bins, likelihood, grid, tracker."""

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.grids import Grid
from faintrack.data.ping_tables import PLATFORMS
from faintrack.data.returns import Returns
from faintrack.errors import InputError
from faintrack.filters.grid import GridFilter
from faintrack.filters.separable import LONGEST, POINTS, separable, separable_unevenly
from faintrack.kinds.returns.pairs import SonarPair, heard
from faintrack.kinds.returns.sections import GridSection, ReturnsScenario, SonarSection
from faintrack.kinds.several import Tracker, build_several
from faintrack.likelihoods.exceedances import FADES, STEADY, ExceedanceLikelihood
from faintrack.likelihoods.guided import Guided
from faintrack.likelihoods.multistatic import Multistatic
from faintrack.sensors.active import ActiveSonar, Pulse
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.signal.multistatic_background import MultistaticBackground
from faintrack.signal.pings import Binned, in_bins
from faintrack.signal.resolution import linked_bins, thinned, wider
from faintrack.signal.returns_background import ReturnsBackground, returns_background
from faintrack.targets.motion import OrnsteinUhlenbeck
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth
from faintrack.trackers.many import ManyTargetsTracker

VELOCITY_SHARE = 0.4
"""Standard deviation of a velocity component in the long run, over the grid's largest."""

UNEVEN = 0.02
"""Of an interval: pings that are no farther from whole numbers of them after the one before come evenly."""

LONGEST_GAP = 1000
"""Intervals between two pings at most: what is believed is carried over each of them."""

LARGEST_GRID = 20_000_000
"""Cells of a grid at most: each takes some fifty bytes."""

MOST_PARTS = 4
"""Parts of the patch of a mesh point in which crossings are looked for."""

LARGEST_TABLE = 20_000_000
"""Numbers at most in what is held besides: tables of likelihood and motion."""

MOST_SAMPLES = 100_000_000
"""Of the likelihood around all returns of a ping, at most: each takes some ten numbers."""


class Spacing(NamedTuple):
    """How pings come.

    Attributes
    ----------
    interval : from one to the next, where they come evenly; otherwise the median. s.
    even : whether every interval is a whole multiple of it; otherwise the interval of every ping is its own.
    """

    interval: float
    even: bool

    @property
    def longest(self) -> float:
        """Of the steps in which motion is carried on; s."""
        return self.interval * (1.0 if self.even else LONGEST)


def ping_spacing(returns: Returns) -> Spacing:
    """How the pings of returns come.

    Raises
    ------
    InputError : one ping alone, or an interval of very many usual ones.
    """
    if returns.length < 2:
        raise InputError(
            f"{returns.origin}: there is one ping; expected two or more, from which their interval is known."
        )
    intervals = np.diff(returns.times)
    shortest = float(intervals.min())
    # The shortest is one of several that are rounded in the file: their mean is nearer.
    interval = float(np.mean(intervals[intervals < 1.5 * shortest]))
    number = intervals / interval
    even = bool(np.all(np.abs(number - np.round(number)) <= UNEVEN))
    if not even:
        # Of two in the middle the shorter, which a gap is not.
        interval = float(np.sort(intervals)[(len(intervals) - 1) // 2])
    if intervals.max() > (LONGEST_GAP + 0.5) * interval:
        first = int(np.argmax(intervals))
        raise InputError(
            f"{returns.origin}: the ping with time_s {returns.times[first + 1]:.10g} comes {intervals[first]:.6g} s "
            f"after the one before; expected at most {LONGEST_GAP} times {interval:.6g} s, the usual interval."
        )
    return Spacing(interval, even)


def build_grid(scenario: ReturnsScenario) -> Grid:
    """Grid of a scenario.

    Raises
    ------
    InputError : too many cells.
    """
    table = scenario.grid
    speed = between(-table.speed, table.speed, table.speeds)
    x, y = (between(*ends, count) for ends, count in zip((table.x, table.y), table.cells, strict=True))
    grid = Grid(PlanarState, (("x", x), ("y", y), ("vx", speed), ("vy", speed)))
    if grid.size > LARGEST_GRID:
        listed = " x ".join(map(str, grid.shape))
        raise InputError(
            f"the grid has {listed} cells, more than {LARGEST_GRID:,}; expected fewer grid.cells or grid.speeds."
        )
    return grid


def build_sonar(table: SonarSection) -> ActiveSonar:
    """Sonar of a scenario, with source and receiver if it says of both where they stand."""
    delay, doppler = sonar_axes(table)
    pair = None
    if table.source is not None and table.receiver is not None:
        pair = Bistatic(fixed(*table.source), fixed(*table.receiver), table.sound_speed)
    assert table.pulse is not None
    return ActiveSonar(
        Pulse(**table.pulse.model_dump(exclude={"sweep", "code", "replica"})),
        delay,
        table.beams,
        math.radians(table.beam_width_deg),
        doppler,
        pair,
        _around(table.reach, table),
    )


def build_likelihood(table: SonarSection, sonar: ActiveSonar) -> ExceedanceLikelihood:
    """What returns of a sonar say of a target, which their simulation draws from as well."""
    threshold, snr = (10 ** (value / 10) for value in (table.threshold_db, table.snr_db))
    return ExceedanceLikelihood(sonar, snr, threshold, FADES if table.fading == "ping" else STEADY)


def build_moving(pair: SonarPair, returns: Returns) -> Bistatic | None:
    """Source and receiver in every ping; None where both stand still.

    Raises
    ------
    InputError : neither scenario nor returns tell where source or receiver are.
    """
    placed, moves = {}, False
    for name, columns in PLATFORMS.items():
        moving, still = getattr(returns, name), getattr(pair.table, name)
        if moving is None and still is None:
            called = getattr(pair, name)
            field = f"the place of {name} {called!r}" if called else f"sonar.{name}"
            raise InputError(
                f"{field} is missing; expected metres east and north, or the columns {', '.join(columns)} "
                "in the returns."
            )
        values = np.broadcast_to([*still, 0.0, 0.0], (returns.length, 4)) if moving is None else moving
        placed[name] = PlanarState(*(jnp.asarray(part, float) for part in values.T))
        moves = moves or moving is not None
    return Bistatic(**placed, sound_speed=pair.table.sound_speed) if moves else None


def sonar_axes(table: SonarSection) -> tuple[Axis, Axis | None]:
    """Bins of delay and, where it is measured, of Doppler."""
    doppler = None if table.doppler is None else _axis(table.doppler, table.doppler_bins, table.doppler_step)
    return _axis(table.delay, table.delay_bins, table.delay_step), doppler


def expected_returns(table: SonarSection) -> float:
    """Number of returns of a ping without a target, on average."""
    delay, doppler = sonar_axes(table)
    size = delay.count * table.beams * (1 if doppler is None else doppler.count)
    return size * math.exp(-(10 ** (table.threshold_db / 10)))


def _around(bins: tuple[int, int, int], table: SonarSection) -> tuple[int, int, int]:
    """Bins on either side, in bearing no more than there are."""
    return bins[0], min(bins[1], (table.beams - 1) // 2), bins[2]


def _axis(ends: tuple[float, float], bins: int | None, step: float | None) -> Axis:
    first, last = ends
    if step is None:
        assert bins is not None
        return Axis(first, (last - first) / (bins - 1), bins)
    return Axis(first, step, round((last - first) / step) + 1)


def velocity_noise(scenario: ReturnsScenario) -> float:
    """Density of the acceleration of targets, that of the scenario or its default; m/s per root second."""
    noise, relaxation = scenario.target.velocity_noise, scenario.target.relaxation
    return VELOCITY_SHARE * scenario.grid.speed * math.sqrt(2 / relaxation) if noise is None else noise


def chosen(scenario: ReturnsScenario, every: tuple[int, int, int] | None) -> ReturnsScenario:
    """Scenario with what was chosen filled in.

    Parameters
    ----------
    scenario : as given.
    every : of `BackgroundSection`; None where several pairs have their own, which the returns tell again.
    """
    target = scenario.target.model_copy(update={"velocity_noise": velocity_noise(scenario)})
    every = scenario.background.every if every is None else every
    background = scenario.background.model_copy(update={"every": every})
    return scenario.model_copy(update={"target": target, "background": background})


@dataclass(frozen=True)
class PairReturns:
    """What one pair of a source and a receiver heard, in bins.

    Attributes
    ----------
    pair : the two.
    binned : returns in independent bins.
    every : every how many bins of the pair's sonar these are.
    """

    pair: SonarPair
    binned: Binned
    every: tuple[int, int, int]

    @property
    def threshold(self) -> float:
        """That returns exceed, over the mean power of the model's noise; linear."""
        return float(10 ** (self.pair.table.threshold_db / 10))


def build_binned(scenario: ReturnsScenario, returns: Returns) -> tuple[PairReturns, ...]:
    """Returns in the independent bins of a scenario's sonar, of each pair that reports.

    Raises
    ------
    InputError : a return that the sonar cannot have heard, see `faintrack.signal.pings.in_bins`; source or receiver are
        nowhere; returns name a pair that the scenario does not.
    """
    every_pair = []
    for pair, part in heard(scenario, returns):
        threshold = 10 ** (pair.table.threshold_db / 10)
        binned = in_bins(part, build_sonar(pair.table), threshold, build_moving(pair, part))
        every = scenario.background.every
        if every is None:
            every = linked_bins(binned) if scenario.background.learn else (1, 1, 1)
        every_pair.append(PairReturns(pair, thinned(binned, every, threshold), every))
    return tuple(every_pair)


def build_background(
    scenario: ReturnsScenario, tracker: Tracker, parts: tuple[PairReturns, ...]
) -> ReturnsBackground | MultistaticBackground | None:
    """What learns the background, if the scenario asks for it and the tracker tells what to leave out."""
    if not scenario.background.learn or not isinstance(tracker, ManyTargetsTracker):
        return None
    shape = scenario.background.shape
    each = tuple(returns_background(part.binned.sonar, part.threshold, shape) for part in parts)
    return each[0] if len(each) == 1 else MultistaticBackground(each)


def build_tracker(scenario: ReturnsScenario, parts: tuple[PairReturns, ...], grid: Grid, spacing: Spacing) -> Tracker:
    """Tracker of a scenario for the returns of each pair.

    Raises
    ------
    InputError : the samples of a ping are too many, or targets pass the grid between two pings.
    """
    grid_table, target_table = scenario.grid, scenario.target
    noise = velocity_noise(scenario)
    _require_slow(grid_table, noise, spacing.longest)
    guided = []
    for part in parts:
        table, sonar = part.pair.table, part.binned.sonar
        swath, finer = _samples(table, sonar, part.every)
        known = build_likelihood(table, sonar)
        _require_room(part.binned, swath, finer, len(known.fading))
        guided.append(Guided(known, grid, swath, finer))
    _require_crossings(guided, parts)
    likelihood = guided[0] if len(guided) == 1 else Multistatic(guided)
    motion = OrnsteinUhlenbeck(noise, target_table.relaxation)
    low, high = (
        PlanarState(*(jnp.asarray(float(axis.edges[end]), jnp.float32) for _, axis in grid.axes)) for end in (0, -1)
    )
    target = Target(UniformBirth(low, high), motion, target_table.arrival_rate, target_table.departure_rate)
    transport = (separable if spacing.even else separable_unevenly)(grid, motion, spacing.interval)
    carried = GridFilter(grid, target, transport, returns=True)
    return build_several(carried, likelihood, scenario.tracker, spacing.interval)


def _samples(
    table: SonarSection, sonar: ActiveSonar, every: tuple[int, int, int]
) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Swath and samples a bin, as near each other as the scenario has them."""
    delay, bearing, doppler = wider(table.swath, every)
    swath = delay, min(bearing, (sonar.beams - 1) // 2), doppler
    finer = table.finer[0] * every[0], table.finer[1] * every[1], table.finer[2] * every[2]
    return swath, finer


def _require_room(binned: Binned, widths: tuple[int, int, int], finer: tuple[int, int, int], fades: int) -> None:
    """Refuse pings and swaths that no memory holds."""
    axes = 2 if binned.sonar.doppler is None else 3
    swath = list(zip(binned.sonar.reach, widths, finer, strict=True))[:axes]
    samples = fades * math.prod(2 * width * finer + 1 for _, width, finer in swath)
    if binned.capacity * samples > MOST_SAMPLES:
        raise InputError(
            f"a ping has up to {binned.returns.counts.max()} returns, with {samples:,} samples of the likelihood "
            f"around each; expected at most {MOST_SAMPLES // samples} returns: a higher sonar.threshold_db, or a "
            "smaller sonar.swath or sonar.finer."
        )
    offsets = math.prod(2 * finer * (max(reach, width) + 2 * width + 1) + 1 for reach, width, finer in swath)
    if fades * offsets > LARGEST_TABLE:
        raise InputError(
            f"a return bears on another at {offsets:,} offsets; expected a smaller sonar.reach, sonar.swath or "
            "sonar.finer."
        )


def _require_crossings(guided: list[Guided], parts: tuple[PairReturns, ...]) -> None:
    """Refuse returns of two pairs whose crossings no memory holds."""
    for first, second in itertools.combinations(range(len(parts)), 2):
        bearings = [2 * each.swath[1] * each.mesh.finer[1] + 1 for each in guided]
        capacity = [part.binned.capacity for part in parts]
        crossings = capacity[first] * capacity[second] * MOST_PARTS * max(bearings[first], bearings[second])
        if crossings > 4 * LARGEST_TABLE:
            raise InputError(
                f"{parts[first].pair.name} and {parts[second].pair.name} have up to {capacity[first]} and "
                f"{capacity[second]} returns in a ping, which may cross at {crossings:,} places; expected fewer: a "
                "higher threshold_db, or a smaller swath or finer."
            )


def _require_slow(table: GridSection, noise: float, interval: float) -> None:
    """Refuse targets that pass the grid between two pings, and motion that no memory holds."""
    # Six standard deviations of what acceleration adds.
    way = table.speed * interval + 3.5 * noise * interval**1.5
    for name, (low, high), count in zip("xy", (table.x, table.y), table.cells, strict=True):
        passed = way / (high - low) * count
        if passed > count or 2 * passed * table.speeds**2 * POINTS > LARGEST_TABLE:
            raise InputError(
                f"targets move up to {way:.3g} m between two pings, {passed:.3g} cells of the {count} of grid.{name}, "
                f"with {table.speeds} speeds; expected a larger grid, fewer cells, or a lower grid.speed."
            )
