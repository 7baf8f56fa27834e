"""From the sections of a scenario to what tracks in sets of bearings: sensor, birth density, filter."""

import math

import jax.numpy as jnp

from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.kinds.bearings.sections import BearingsScenario, BearingsSection
from faintrack.kinds.several import Tracker, build_several
from faintrack.likelihoods.bearing_sets import BearingSetLikelihood
from faintrack.likelihoods.several_sets import SeveralSetsLikelihood
from faintrack.sensors.bearing_sets import BearingSensor
from faintrack.targets.births import RangeBirth
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth

STEADY = 0.1, 60.0
"""By default acceleration adds up to so much of the largest speed in so many seconds."""


def build_sensor(table: BearingsSection) -> BearingSensor:
    """Detector of a scenario; its sector goes anticlockwise from +x."""
    start, width = -180.0, 360.0
    if table.sector_deg is not None:
        first, last = table.sector_deg
        start, width = 90 - last, (last - first) % 360
    return BearingSensor(
        math.radians(table.error_deg),
        table.detection_probability,
        table.false_per_scan,
        math.radians(start),
        math.radians(width),
    )


def build_birth(table: BearingsSection) -> RangeBirth | UniformBirth:
    """Where new targets appear: at a range from the observer, or in a region."""

    def corner(*values: float) -> PlanarState:
        return PlanarState(*(jnp.asarray(value, jnp.float32) for value in values))

    fast = table.speed
    if table.range is not None:
        sensor = build_sensor(table)
        return RangeBirth(corner(0, 0, 0, 0), *table.range, fast, sensor.start, sensor.width)
    assert table.x is not None, "the section has a range, or x and y"
    assert table.y is not None, "the section has a range, or x and y"
    return UniformBirth(corner(table.x[0], table.y[0], -fast, -fast), corner(table.x[1], table.y[1], fast, fast))


def velocity_noise(scenario: BearingsScenario) -> float:
    """Density of the acceleration of targets, that of the scenario or its default; m/s per root second."""
    share, seconds = STEADY
    noise = scenario.target.velocity_noise
    return share * scenario.bearings.speed / math.sqrt(seconds) if noise is None else noise


def chosen(scenario: BearingsScenario) -> BearingsScenario:
    """Scenario with what was chosen filled in."""
    target = scenario.target.model_copy(update={"velocity_noise": velocity_noise(scenario)})
    return scenario.model_copy(update={"target": target})


def build_tracker(scenario: BearingsScenario, interval: float) -> Tracker:
    """Tracker of a scenario for sets of bearings that come so many seconds apart."""
    table, known = scenario.bearings, scenario.target
    motion = PlanarMotion(velocity_noise(scenario))
    target = Target(build_birth(table), motion, known.arrival_rate, known.departure_rate)
    particles = BernoulliParticleFilter(target, scenario.filter.particles, scenario.filter.births)
    likelihood = SeveralSetsLikelihood(BearingSetLikelihood(build_sensor(table)))
    return build_several(particles, likelihood, scenario.tracker, interval, guided=True)
