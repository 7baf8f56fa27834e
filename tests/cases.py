"""Every likelihood, filter and tracker of the package, each small, with what the laws need to know of it.

A new one gets a line here, and every law runs on it: those of likelihoods in `tests/laws/test_every_likelihood.py`,
those of filters and trackers in `tests/laws/test_every_filter.py`.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.belief import Belief
from faintrack.beliefs.grids import Grid
from faintrack.filters.adi import alternating_directions
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.cell_particles import CellParticles
from faintrack.filters.existence_particle import ExistenceParticleFilter, OfPossible, PossibleState, of_target
from faintrack.filters.grid import GridFilter
from faintrack.filters.separable import separable
from faintrack.filters.shifts import Shifts
from faintrack.likelihoods.beam_energies import BeamEnergies
from faintrack.likelihoods.bearing_sets import BearingSetLikelihood
from faintrack.likelihoods.cells import (
    CellLikelihood,
    gaussian,
    gaussian_spread,
    rayleigh,
    swerling0,
    swerling1,
)
from faintrack.likelihoods.clutter import ClutterLikelihood
from faintrack.likelihoods.contact_sets import ContactSetLikelihood
from faintrack.likelihoods.contacts import BearingContact, Contact, GaussianContact, RangeDetection, Together
from faintrack.likelihoods.exceedances import ExceedanceLikelihood
from faintrack.likelihoods.guided import Guided
from faintrack.likelihoods.heavy_tails import student
from faintrack.likelihoods.lobe_width import lobe_width_likelihood
from faintrack.likelihoods.multistatic import Multistatic
from faintrack.likelihoods.protocols import with_others
from faintrack.likelihoods.random_points import RandomPoints
from faintrack.likelihoods.several_sets import SeveralSetsLikelihood
from faintrack.likelihoods.superposed import SuperposedLikelihood
from faintrack.likelihoods.unknown_level import UnknownLevel
from faintrack.likelihoods.unknown_noise import UnknownNoise
from faintrack.likelihoods.unknown_snr import GuidedSnr
from faintrack.likelihoods.unknown_tone import UnknownTone
from faintrack.likelihoods.white_signal import WhiteSignal
from faintrack.sensors.active import ActiveSonar, Ping, Pulse
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid, BeamScan
from faintrack.sensors.bearing_sets import BearingSensor, BearingSet
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.sensors.cells import Cells, CellScan
from faintrack.sensors.contact_sets import ContactSensor, ContactSet
from faintrack.sensors.multistatic import Pings
from faintrack.sensors.several_sets import SeveralSets
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.sensors.superposed import SensorNetwork, inverse_square, picture
from faintrack.sensors.tones import ToneScan
from faintrack.signal.clutter import ClutterScan, Level
from faintrack.signal.tones import ToneAnalysis, tone_analysis
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import BearingState, PlanarSnrState, PlanarState, RangeState, ToneState, WaveState
from faintrack.targets.target import Target, UniformBirth, rates
from tests.scenes import CIRCLE, COLOURED, LINE, SPACE

FEW, MANY = 6_000, 20_000
"""Draws for a law of means: of ratios with tails that fall fast, and of those of an array, whose standard error is then
below 0.01."""


@dataclass(frozen=True)
class Case:
    """A likelihood and what is asked of it.

    Attributes
    ----------
    likelihood : what it is.
    scan : template for draws.
    states : some, components of shape (point,); ratios of low variance there.
    draws : for a law of means.
    """

    likelihood: Any
    scan: Any
    states: Any
    draws: int = FEW


def row(kind: Any, dtype: type, *points: tuple[float, ...]) -> Any:
    """States with components of shape (point,)."""
    return kind(*(jnp.asarray(values, dtype) for values in zip(*points, strict=True)))


def corner(kind: Any, dtype: type, *values: float) -> Any:
    """One state of scalars."""
    return kind(*(jnp.asarray(value, dtype) for value in values))


# Beams of an array


def array_case(array: SensorArray, build: Callable[[BeamGrid, type], Any], dtype: type) -> Case:
    """Four channels, three bins, two snapshots; points on the beams, between them and at the end."""
    grid = BeamGrid(np.array([125.0, 250.0, 375.0]), 36, 2, array.circular, array)
    scan = BeamScan(*(jnp.zeros(shape, dtype) for shape in ((), (3, 36), 3)), jnp.asarray(4.0, dtype))
    bearing = [*grid.bearing[[7, 20, -1]], 0.4, 2.9]
    states = row(BearingState, dtype, *zip(bearing, [0.0] * 5, (-13.0, -15.0, -12.0, -12.5, -14.0), strict=True))
    return Case(build(grid, dtype), scan, states, draws=MANY)


def wave_case(dtype: type) -> Case:
    """As `array_case`, two rings of beams between two more, and points between them; on channels of unequal height."""
    rings = tuple((0.25 * np.arange(-1, 3)).tolist())
    grid = BeamGrid(np.array([125.0, 250.0, 375.0]), 36, 2, True, SPACE, elevations=rings)
    scan = BeamScan(*(jnp.zeros(shape, dtype) for shape in ((), (3, 144), 3)), jnp.asarray(4.0, dtype))
    levels, elevation = (-13.0, -15.0, -12.0, -12.5), (0.25, 0.0, 0.08, 0.17)
    states = row(WaveState, dtype, *zip((*grid.bearing[[7, 20]], 0.4, 2.9), [0.0] * 4, levels, elevation, strict=True))
    return Case(unknown_noise(grid, dtype), scan, states, draws=MANY)


def too_few(scan: BeamScan) -> BeamScan:
    """One channel has no direction."""
    return dataclasses.replace(scan, channels=jnp.ones_like(scan.channels))


def white_signal(grid: BeamGrid, dtype: type) -> WhiteSignal:
    return WhiteSignal(grid, jnp.asarray(COLOURED, dtype))


def unknown_noise(grid: BeamGrid, dtype: type) -> UnknownNoise:
    # Columns a decibel apart, no more of them than the points need: the table is most of the cost of a draw.
    return UnknownNoise(grid, (-18.0, -9.0))


def lobe_width(grid: BeamGrid, dtype: type) -> Any:
    return lobe_width_likelihood(grid, width=0.5)


# Cells

IMAGE = Cells((("y", Axis(0.0, 1.0, 5)), ("x", Axis(0.0, 1.0, 6))))
LEVELS = {gaussian: 0.8, swerling1: 0.3, swerling0: 0.5, rayleigh: 0.3, student(5.0): 0.8}
"""Levels at which the ratio has a variance: that of `swerling1` has none from 1 on."""
PIXELS = ((1.6, 3.4, 0.0, 0.0), (0.1, 5.0, 0.0, 0.0), (2.0, 2.0, 0.0, 0.0), (20.0, 2.0, 0.0, 0.0))
"""Between pixels, at the edge, in the middle, and where nothing is heard."""


def image(amplitude: Any, level: float | None = None, oversample: int = 1) -> CellLikelihood:
    # Places within a cell are the same for every amplitude, and nine times as much to compile: one case has them.
    level = LEVELS[amplitude] if level is None else level
    return CellLikelihood(IMAGE, amplitude, level, gaussian_spread(0.6), reach=1, oversample=oversample)


def cell_case(build: Callable[[], Any], dtype: type) -> Case:
    scan = CellScan(jnp.zeros((), dtype), jnp.zeros(IMAGE.shape, dtype))
    return Case(build(), scan, row(PlanarState, dtype, *PIXELS))


def unseen(scan: Any) -> Any:
    """No cell, or sensor, has a value."""
    return dataclasses.replace(scan, values=jnp.full_like(scan.values, jnp.nan))


def clutter_case(dtype: type) -> Case:
    profile = Cells((("range", Axis(0.0, 1.0, 6)),))
    level = Level(jnp.full(6, 6.0, dtype), jnp.linspace(2.0, 9.0, 6, dtype=dtype))
    scan = ClutterScan(jnp.zeros((), dtype), jnp.zeros(6, dtype), level)
    states = row(RangeState, dtype, (1.2, 0.0), (5.0, 0.0), (9.0, 0.0))
    return Case(ClutterLikelihood(profile, 0.3), scan, states)


# Targets in superposition


@functools.cache
def network(dtype: type = np.float32) -> SensorNetwork:
    """Nine sensors that hear little, so that ratios have a low variance."""
    x, y = (jnp.asarray(each.ravel(), dtype) for each in np.meshgrid(*[np.array([0.0, 10.0, 20.0])] * 2))
    return SensorNetwork(x, y, inverse_square(20.0, 5.0))


def superposed(dtype: type = np.float32) -> SuperposedLikelihood:
    place = between(0.0, 20.0, 8)
    return SuperposedLikelihood(network(dtype), Grid(PlanarState, (("x", place), ("y", place))))


def superposed_case(dtype: type, beside: bool = False) -> Case:
    likelihood, scan = superposed(dtype), picture(0.0, jnp.zeros(9, dtype))
    if beside:
        others = PlanarState(
            *(jnp.asarray(each, dtype) for each in ([[4.0, 8.0, 5.0]], [[12.0] * 3], *[[[0.0] * 3]] * 2))
        )
        equal = jnp.full((1, 3), -math.log(3), dtype)
        scan = with_others(likelihood, scan, others, equal, jnp.array([0.6], dtype))
    points = (3.0, 4.0, 0.0, 0.0), (12.0, 14.0, 0.0, 0.0), (40.0, 0.0, 0.0, 0.0)
    return Case(likelihood, scan, row(PlanarState, dtype, *points))


# Beams of several arrays


def energies_case(dtype: type, elsewhere: float = 0.0) -> Case:
    beam = math.radians(5)
    likelihood = BeamEnergies(Fans((0.0, 0.0), (beam, beam), (37, 30), (True, True)), 0.0, 1.0, 0.7, 1.1, elsewhere)
    heading = jnp.array([math.pi / 2, 0.0], dtype)
    stations = Stations(jnp.array([0.0, -500.0], dtype), jnp.array([-500.0, 0.0], dtype), heading)
    usable = jnp.ones((2, 37), bool).at[1, 30:].set(False).at[0, 20].set(False)
    scan = EnergyScan(jnp.zeros((), dtype), jnp.zeros((2, 37), dtype), usable, stations)
    points = (100.0, 50.0, 0.0, 0.0), (-200.0, 300.0, 0.0, 0.0), (0.0, 900.0, 0.0, 0.0)
    return Case(likelihood, scan, row(PlanarState, dtype, *points))


def energies_masked(scan: EnergyScan) -> EnergyScan:
    """Beams that cannot be used hold no number."""
    return dataclasses.replace(scan, energy=jnp.where(scan.usable, scan.energy, jnp.nan))


def silent(scan: EnergyScan) -> EnergyScan:
    """No beam can be used."""
    return dataclasses.replace(scan, usable=jnp.zeros_like(scan.usable))


# Returns of an active sonar


def sonar() -> ActiveSonar:
    """Bins so coarse that a ping has a handful of returns."""
    pair = Bistatic(fixed(0.0, 0.0), fixed(300.0, 200.0))
    pulse = Pulse(2000.0, 1.0, 10.0)
    return ActiveSonar(pulse, Axis(2.0, 0.1, 40), 12, math.radians(12), None, pair, reach=(2, 1, 0))


def exceedances(snr: float = 0.4) -> ExceedanceLikelihood:
    return ExceedanceLikelihood(sonar(), snr, 4.0)


def returns_case(likelihood: Any, dtype: type, *points: tuple[float, ...], kind: Any = PlanarState) -> Case:
    capacity = 32
    scan = Ping(
        jnp.zeros((), dtype),
        jnp.zeros((capacity, 3), jnp.int32),
        jnp.zeros(capacity, dtype),
        jnp.zeros(capacity, bool),
    )
    return Case(likelihood, scan, row(kind, dtype, *points))


def returns_masked(ping: Ping) -> Ping:
    """Entries that are no returns hold a loud one."""
    bins = jnp.where(ping.there[:, None], ping.bins, 3)
    return dataclasses.replace(ping, bins=bins, power=jnp.where(ping.there, ping.power, 50.0))


PLACES = (2000.0, 500.0, 0.0, 0.0), (-1000.0, 1500.0, 0.0, 0.0), (90_000.0, 0.0, 0.0, 0.0)
"""Two that are heard, and one that is not."""

# Bearings

SENSOR = BearingSensor(0.6, 0.3, 3.0, -0.5, 5.0)
HEARD = (400.0, 100.0, 0.0, 0.0), (-300.0, -100.0, 0.0, 0.0), (100.0, -400.0, 0.0, 0.0)
"""Two within the sector, as far from its edges as errors reach, and one outside."""


def bearings(dtype: type, count: int = 20) -> BearingSet:
    here = corner(PlanarState, dtype, 10.0, -20.0, 0.0, 0.0)
    return BearingSet(jnp.zeros((), dtype), jnp.zeros(count, dtype), jnp.zeros(count, bool), here)


def bearings_masked(scan: BearingSet) -> BearingSet:
    """Entries that are no bearings hold one."""
    return dataclasses.replace(scan, bearing=jnp.where(scan.there, scan.bearing, 0.3))


def bearings_case(dtype: type) -> Case:
    # An error may carry a target's bearing over the edge of the sector, where it is not reported: far from it.
    sensor = dataclasses.replace(SENSOR, error=0.15)
    return Case(
        BearingSetLikelihood(sensor),
        bearings(dtype),
        row(PlanarState, dtype, *HEARD),
        MANY,
    )


def observers_case(dtype: type) -> Case:
    sensor = dataclasses.replace(SENSOR, error=0.15)
    sets = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), bearings(dtype))
    scan = SeveralSets(jnp.zeros((), dtype), sets, jnp.array([True, True]))
    likelihood = SeveralSetsLikelihood(BearingSetLikelihood(sensor))
    return Case(likelihood, scan, row(PlanarState, dtype, *HEARD))


def nobody(scan: Any) -> Any:
    """No observer, or pair, reported."""
    return dataclasses.replace(scan, heard=jnp.zeros_like(scan.heard))


# Sets of contacts


ECHOES = ContactSensor((0.3, 0.4, 4.0), 0.3, 3.0, ((0.5, 3.0), (-1.5, 2.5), (-20.0, 30.0)), frequency=2000.0)
"""Errors so wide that ratios have a low variance."""

ECHOING = (1200.0, 100.0, -6.0, 2.0), (300.0, 900.0, 3.0, -5.0), (1900.0, 800.0, 0.0, 0.0), (-900.0, 0.0, 9.0, 0.0)
"""In the middle of what is reported, near an edge of delay, at one of them, and outside the sector."""


def contact_set(dtype: type, count: int = 20) -> ContactSet:
    platforms = (corner(PlanarState, dtype, *values, 0.0, 0.0) for values in ((0.0, 0.0), (300.0, -200.0)))
    return ContactSet(jnp.zeros((), dtype), jnp.zeros((count, 3), dtype), jnp.zeros(count, bool), Bistatic(*platforms))


def contacts_masked(scan: ContactSet) -> ContactSet:
    """Entries that are no contacts hold one."""
    return dataclasses.replace(scan, values=jnp.where(scan.there[:, None], scan.values, 1.3))


def contact_set_case(dtype: type) -> Case:
    return Case(ContactSetLikelihood(ECHOES), contact_set(dtype), row(PlanarState, dtype, *ECHOING), MANY)


def contacts_of_pairs_case(dtype: type) -> Case:
    """Ranges without Doppler, all around, of two pairs."""
    sensor = ContactSensor((400.0, 0.5), 0.3, 3.0, ((200.0, 3000.0), (-math.pi, math.pi)), ranged=True)
    one = contact_set(dtype)
    one = dataclasses.replace(one, values=one.values[:, :2])
    sets = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), one)
    scan = SeveralSets(jnp.zeros((), dtype), sets, jnp.array([True, True]))
    likelihood = SeveralSetsLikelihood(ContactSetLikelihood(sensor))
    return Case(likelihood, scan, row(PlanarState, dtype, *ECHOING), MANY)


# Tones


HUMS = (1.2, 0.0, -6.0, 60.0), (2.0, 0.0, 3.0, 90.5), (0.1, 0.0, 10.0, 120.25)
"""At frequencies of the grid: a scan is drawn for these."""


def tone_plan() -> ToneAnalysis:
    return tone_analysis(LINE, 400.0, 1.0, (50.0, 150.0), 24)


def tone_scan(dtype: type) -> ToneScan:
    plan = tone_plan()
    count, channels = plan.grid.count, len(plan.gains)
    wide = np.result_type(dtype, np.complex64)
    power = jnp.zeros((count, plan.grid.beams), dtype)
    references = jnp.asarray(plan.references, dtype)
    heard = jnp.asarray(channels, dtype)
    spectra = jnp.zeros((count, channels), wide)
    return ToneScan(jnp.zeros((), dtype), spectra, power, power, references * channels, references, heard)


def tone_case(dtype: type) -> Case:
    # Draws of gamma variables are loops.
    return Case(UnknownTone(tone_plan().grid), tone_scan(dtype), row(ToneState, dtype, *HUMS), 50)


# Contacts


def contact(dtype: type, value: Any = 0.0) -> Contact:
    return Contact(jnp.zeros((), dtype), jnp.asarray(value, dtype))


NEAR = (0.0, 0.0, 0.0, 0.0), (1.0, -1.0, 0.0, 0.0)
"""Far from the edges of the region of false contacts, in standard deviations."""


def position(dtype: type) -> GaussianContact:
    return GaussianContact(("x", "y"), jnp.diag(jnp.array([1.0, 2.0], dtype)), (-10.0, -10.0), (10.0, 10.0))


def detection() -> RangeDetection:
    return RangeDetection((70.0, 0.0), lambda distance: 0.2 + 0.6 * jnp.exp(-distance / 50.0), 0.3)


def contact_case(likelihood: Any, dtype: type, value: Any = 0.0, scan: Any = None) -> Case:
    scan = contact(dtype, value) if scan is None else scan
    return Case(likelihood, scan, row(PlanarState, dtype, *NEAR), MANY)


def possible_case(dtype: type) -> Case:
    inner = cell_case(lambda: image(gaussian), dtype)
    states = PossibleState(inner.states, jnp.array([True, False, True, False]))
    return dataclasses.replace(inner, likelihood=OfPossible(inner.likelihood), states=states)


LIKELIHOODS: dict[str, Callable[[type], Case]] = {
    "white signal, line": functools.partial(array_case, LINE, white_signal),
    "white signal, circle": functools.partial(array_case, CIRCLE, white_signal),
    "unknown noise, line": functools.partial(array_case, LINE, unknown_noise),
    "unknown noise, circle": functools.partial(array_case, CIRCLE, unknown_noise),
    "unknown noise, above the horizon": wave_case,
    "lobe width": functools.partial(array_case, LINE, lobe_width),
    "cells, gaussian": functools.partial(cell_case, lambda: image(gaussian, oversample=3)),
    "cells, swerling1": functools.partial(cell_case, lambda: image(swerling1)),
    "cells, swerling0": functools.partial(cell_case, lambda: image(swerling0)),
    "cells, rayleigh": functools.partial(cell_case, lambda: image(rayleigh)),
    # Draws of Student's distribution are loops, a hundred times as dear as others.
    "cells, student": lambda dtype: dataclasses.replace(cell_case(lambda: image(student(5.0)), dtype), draws=2_000),
    "unknown level": functools.partial(cell_case, lambda: UnknownLevel((image(gaussian, 0.5), image(gaussian, 1.0)))),
    "clutter": clutter_case,
    "superposed": superposed_case,
    "superposed, beside": functools.partial(superposed_case, beside=True),
    "beam energies": energies_case,
    "beam energies, sources elsewhere": functools.partial(energies_case, elsewhere=0.05),
    "exceedances": lambda dtype: returns_case(exceedances(), dtype, *PLACES),
    "bearing sets": bearings_case,
    "observers": observers_case,
    "position": lambda dtype: contact_case(position(dtype), dtype, np.zeros(2)),
    "bearing": lambda dtype: contact_case(BearingContact((70.0, 0.0), 0.9), dtype),
    "contact sets": contact_set_case,
    "contacts of pairs": contacts_of_pairs_case,
    "tone": tone_case,
    "detection": lambda dtype: contact_case(detection(), dtype, False),
    "together": lambda dtype: contact_case(
        Together((BearingContact((70.0, 0.0), 0.9), detection())), dtype, scan=(contact(dtype), contact(dtype))
    ),
    "of possible": possible_case,
}
"""Those that read states."""

NO_RATIO = ("lobe width", "tone")
"""Their mean under noise is not 1, and they say so."""

NO_INVERSE = (*NO_RATIO, "position")
"""The inverse of their ratio has no variance: a Gaussian is nothing to speak of at the edge of the region."""

QUIET: dict[str, Callable[[Any], Any]] = {
    "white signal, line": too_few,
    "white signal, circle": too_few,
    "unknown noise, line": too_few,
    "unknown noise, circle": too_few,
    "lobe width": too_few,
    "tone": too_few,
    "cells, gaussian": unseen,
    "cells, swerling1": unseen,
    "cells, swerling0": unseen,
    "cells, rayleigh": unseen,
    "cells, student": unseen,
    "unknown level": unseen,
    "of possible": unseen,
    "superposed": unseen,
    "superposed, beside": unseen,
    "beam energies": silent,
    "beam energies, sources elsewhere": silent,
    "observers": nobody,
    "contacts of pairs": nobody,
}
"""What makes of a scan one in which nothing was measured; of other sensors silence is a measurement."""

MASKED: dict[str, Callable[[Any], Any]] = {
    "beam energies": energies_masked,
    "beam energies, sources elsewhere": energies_masked,
    "exceedances": returns_masked,
    "bearing sets": bearings_masked,
    "contact sets": contacts_masked,
}
"""What puts something else where a scan holds nothing."""


# Means over cells


def position_grid(count: int, **axes: Axis) -> Grid:
    place = between(-3000.0, 3000.0, count)
    kind = PlanarSnrState if "snr_db" in axes else PlanarState
    return Grid(kind, (("x", place), ("y", place), *axes.items()))


def guided_case(dtype: type) -> Case:
    return returns_case(Guided(exceedances(), position_grid(5), (2, 1, 0)), dtype, *PLACES)


def guided_snr_case(dtype: type) -> Case:
    grid = position_grid(5, snr_db=Axis(-6.0, 3.0, 2))
    points = [(*place, -6.0) for place in PLACES]
    return returns_case(GuidedSnr(sonar(), 4.0, grid, swath=(2, 1, 0)), dtype, *points, kind=PlanarSnrState)


def random_points_case(dtype: type) -> Case:
    grid = Grid(PlanarState, (("y", between(-0.5, 4.5, 3)), ("x", between(-0.5, 5.5, 2))))
    inner = cell_case(lambda: image(gaussian), dtype)
    means = RandomPoints(inner.likelihood, grid, 4, jax.random.key(0))
    return dataclasses.replace(inner, likelihood=means)


def multistatic_case(dtype: type) -> Case:
    """Two receivers, the second with a wider beam."""
    other = dataclasses.replace(sonar(), pair=Bistatic(fixed(0.0, 0.0), fixed(-900.0, 1200.0)), beams=9)
    both = exceedances(), ExceedanceLikelihood(other, 0.4, 4.0)
    means = Multistatic([Guided(each, position_grid(5), (2, 1, 0)) for each in both])
    one = returns_case(means, dtype, *PLACES)
    return dataclasses.replace(one, scan=Pings(jnp.zeros((), dtype), (one.scan, one.scan), jnp.ones(2, bool)))


CELL_MEANS: dict[str, Callable[[type], Case]] = {
    "guided": guided_case,
    "guided, unknown SNR": guided_snr_case,
    "multistatic": multistatic_case,
    "random points": random_points_case,
}
"""Those that know the mean of every cell of a grid."""

# Filters

APPEARS, STAYS, NOISE = 0.05, 0.9, 0.3
PLACE, SPEED = Axis(0.0, 1.0, 12), Axis(-1.0, 1.0, 3)
LINE_GRID = Grid(RangeState, (("range", PLACE), ("range_rate", SPEED)))
MOTION = PlanarMotion(NOISE)


@functools.cache
def target() -> Target:
    """Along a line of twelve cells, a cell a second at most."""
    low, high = ((float(PLACE.edges[end]), float(SPEED.edges[end])) for end in (0, -1))
    birth = UniformBirth(corner(RangeState, np.float32, *low), corner(RangeState, np.float32, *high))
    return Target(birth, MOTION, *rates(APPEARS, STAYS, 1.0))


def on_grid(transport: Any, **more: Any) -> GridFilter:
    return GridFilter(LINE_GRID, target(), transport, **more)


FILTERS: dict[str, Callable[[], Any]] = {
    "particles": lambda: BernoulliParticleFilter(target(), 200, 100),
    "particles with a bit": lambda: ExistenceParticleFilter(target(), 2000),
    "grid, shifts": lambda: on_grid(Shifts(LINE_GRID, 1.0)),
    "grid, separable": lambda: on_grid(separable(LINE_GRID, MOTION, 1.0)),
    "grid, separable, returns": lambda: on_grid(separable(LINE_GRID, MOTION, 1.0), returns=True),
    "grid, alternating directions": lambda: on_grid(alternating_directions(LINE_GRID, NOISE, 1.0)),
    "grid, cell particles": lambda: on_grid(CellParticles(LINE_GRID, MOTION, 1.0, 4)),
}


def believed(belief: Belief) -> Belief:
    """What a filter believes of a target, whatever its particles are."""
    return of_target(belief) if isinstance(belief.states, PossibleState) else belief


def profile() -> CellLikelihood:
    """Of a target on the line: a range profile in Gaussian noise."""
    return CellLikelihood(Cells((("range", PLACE),)), gaussian, 2.0)


def for_filter(filter: Any) -> Any:
    """Likelihood that takes in its scans."""
    return OfPossible(profile()) if isinstance(filter, ExistenceParticleFilter) else profile()
