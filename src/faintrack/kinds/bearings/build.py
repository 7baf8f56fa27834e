"""From the tables of a scenario to what tracks in sets of bearings: sensor, birth density, filter."""

import math

import jax.numpy as jnp
from faintrack.scenario.bearings import BearingsTable
from faintrack.scenario.model import Scenario

from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.likelihoods.bearing_sets import BearingSetLikelihood, ObserversLikelihood
from faintrack.sensors.bearing_sets import BearingSensor
from faintrack.targets.births import RangeBirth
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth
from faintrack.trackers.single import SingleTargetTracker

STEADY = 0.1, 60.0
"""By default acceleration adds up to so much of the largest speed in so many seconds."""


def build_sensor(table: BearingsTable) -> BearingSensor:
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


def build_birth(table: BearingsTable) -> RangeBirth | UniformBirth:
    """Where new targets appear: at a range from the observer, or in a region."""

    def corner(*values: float) -> PlanarState:
        return PlanarState(*(jnp.asarray(value, jnp.float32) for value in values))

    fast = table.speed
    if table.range is not None:
        sensor = build_sensor(table)
        return RangeBirth(corner(0, 0, 0, 0), *table.range, fast, sensor.start, sensor.width)
    assert table.x is not None, "the table has a range, or x and y"
    assert table.y is not None, "the table has a range, or x and y"
    return UniformBirth(corner(table.x[0], table.y[0], -fast, -fast), corner(table.x[1], table.y[1], fast, fast))


def build_bearings_tracker(scenario: Scenario) -> SingleTargetTracker:
    """Tracker of a scenario for sets of bearings."""
    table, known = scenario.bearings, scenario.target
    assert table is not None, "bearings are tracked with a table of them"
    noise = known.velocity_noise
    if noise is None:
        share, seconds = STEADY
        noise = share * table.speed / math.sqrt(seconds)
    target = Target(build_birth(table), PlanarMotion(noise), known.arrival_rate, known.departure_rate)
    return SingleTargetTracker(
        BernoulliParticleFilter(target, scenario.filter.particles, scenario.filter.births),
        ObserversLikelihood(BearingSetLikelihood(build_sensor(table))),
        scenario.tracker.declare,
        scenario.tracker.drop,
        guided=True,
    )
