"""From the sections of a scenario to what tracks in contacts: sensor, sources and receivers, birth density, filter."""

import itertools
import math
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from faintrack.data.contacts import Contacts
from faintrack.data.ping_tables import LABELS, PLATFORMS
from faintrack.errors import InputError
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.kinds.contacts.sections import ContactsScenario, ContactsSection
from faintrack.kinds.several import Tracker, build_several
from faintrack.likelihoods.contact_sets import ContactSetLikelihood
from faintrack.likelihoods.several_sets import SeveralSetsLikelihood
from faintrack.sensors.bistatic import Bistatic
from faintrack.sensors.contact_sets import ContactSensor
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth

STEADY = 0.1, 600.0
"""By default acceleration adds up to so much of the largest speed in so many seconds."""


def build_sensor(table: ContactsSection) -> ContactSensor:
    """Detector of a scenario whose number of false contacts is known; its sector goes anticlockwise from +x."""
    first, last = (-180.0, 180.0) if table.sector_deg is None else table.sector_deg
    width = 360.0 if table.sector_deg is None else (last - first) % 360
    start = math.radians(90 - first - width)
    distance, error = (table.delay, table.delay_std) if table.range is None else (table.range, table.range_std)
    assert distance is not None, "the section has delays or ranges"
    assert error is not None, "the section has delays or ranges"
    assert table.false_per_ping is not None, "filled in by `chosen`"
    errors = [error, math.radians(table.bearing_std_deg)]
    ends: tuple[tuple[float, float], ...] = (distance, (start, start + math.radians(width)))
    if table.doppler is not None and table.doppler_std is not None:
        errors, ends = [*errors, table.doppler_std], (*ends, table.doppler)
    # As arrays: one compiled program serves all of their values.
    *known, detection, false = (
        jnp.asarray(value, float) for value in (*errors, table.detection_probability, table.false_per_ping)
    )
    return ContactSensor(tuple(known), detection, false, ends, table.range is not None, table.frequency or 0.0)


def build_pairs(scenario: ContactsScenario, contacts: Contacts) -> tuple[Bistatic, ...]:
    """Source and receiver of each of the contacts' pairs, in every ping.

    Raises
    ------
    InputError : neither scenario nor contacts say where one stands; contacts name one that the scenario does not know,
        or none where there are several.
    """
    built = []
    for number, labels in enumerate(contacts.pairs or (("", ""),)):
        placed = {}
        for platform, label in zip(LABELS, labels, strict=True):
            moving = getattr(contacts, platform)
            still = place_of(scenario, platform, label, contacts.origin, moving is not None)
            if moving is None:
                values = np.broadcast_to([*still, 0.0, 0.0], (contacts.length, 4))
            else:
                values = np.nan_to_num(moving[:, number] if contacts.pairs else moving)
            placed[platform] = PlanarState(*(jnp.asarray(part, float) for part in values.T))
        built.append(Bistatic(**placed, sound_speed=scenario.contacts.sound_speed))
    return tuple(built)


def place_of(
    scenario: ContactsScenario, platform: str, label: str, origin: str, moving: bool = False
) -> tuple[float, float]:
    """Where a source or a receiver stands still, metres; anywhere if it moves.

    Parameters
    ----------
    scenario : names and places them.
    platform : "source" or "receiver".
    label : by which the contacts name it, its name or its number from 1 on; empty where they do not.
    origin : of the contacts, for messages.
    moving : whether columns of the contacts tell its place.

    Raises
    ------
    InputError : as of `build_pairs`.
    """
    listed = getattr(scenario, f"{platform}s")
    place, called = getattr(scenario.contacts, platform), f"contacts.{platform}"
    if listed is not None:
        names = [each.name for each in listed]
        if not label and len(names) > 1:
            raise InputError(
                f"{origin}: there is no column {platform}; expected it, since the scenario has {len(names)} "
                f"[[{platform}s]]."
            )
        number = names.index(label) if label in names else int(label) - 1 if label.isdecimal() else -1
        number = 0 if not label else number
        if not 0 <= number < len(names):
            raise InputError(
                f"{origin}: {platform} is {label!r}; expected one of the [[{platform}s]] of the scenario, "
                f"{', '.join(names)}, or its number from 1 on."
            )
        place, called = listed[number].place, f"the place of {platform} {names[number]!r}"
    elif label and not moving:
        raise InputError(
            f"{origin}: there is a column {platform}, and the scenario has no [[{platform}s]]; expected them, with a "
            "name and a place each."
        )
    if place is None and not moving:
        raise InputError(
            f"{called} is missing; expected metres east and north, or the columns {', '.join(PLATFORMS[platform])} in "
            "the contacts."
        )
    return (0.0, 0.0) if place is None else place


def pairs_of(scenario: ContactsScenario) -> tuple[tuple[str, str], ...]:
    """Names of source and receiver of every pair of a scenario; empty where there is one without a name."""
    names: Sequence[list[str]] = [
        [each.name for each in getattr(scenario, f"{name}s") or ()] or [""] for name in LABELS
    ]
    return tuple((source, receiver) for source, receiver in itertools.product(*names))


def velocity_noise(scenario: ContactsScenario) -> float:
    """Density of the acceleration of targets, that of the scenario or its default; m/s per root second."""
    share, seconds = STEADY
    noise = scenario.target.velocity_noise
    return share * scenario.contacts.speed / math.sqrt(seconds) if noise is None else noise


def chosen(scenario: ContactsScenario, contacts: Contacts) -> ContactsScenario:
    """Scenario with what was chosen for some contacts filled in."""
    target = scenario.target.model_copy(update={"velocity_noise": velocity_noise(scenario)})
    table = scenario.contacts
    if table.false_per_ping is None:
        # Where nothing was reported at all, one contact may still come.
        mean = max(len(contacts.ping), 1) / max(int(contacts.heard.sum()), 1)
        table = table.model_copy(update={"false_per_ping": mean})
    return scenario.model_copy(update={"target": target, "contacts": table})


def build_birth(table: ContactsSection) -> UniformBirth:
    """Where new targets appear."""
    low, high = (
        PlanarState(*(jnp.asarray(value, jnp.float32) for value in (table.x[end], table.y[end], fast, fast)))
        for end, fast in enumerate((-table.speed, table.speed))
    )
    return UniformBirth(low, high)


def build_tracker(scenario: ContactsScenario, interval: float) -> Tracker:
    """Tracker of a scenario, with what was chosen filled in, for pings that come so many seconds apart."""
    known = scenario.target
    motion = PlanarMotion(velocity_noise(scenario))
    target = Target(build_birth(scenario.contacts), motion, known.arrival_rate, known.departure_rate)
    particles = BernoulliParticleFilter(target, scenario.filter.particles, scenario.filter.births)
    likelihood = SeveralSetsLikelihood(ContactSetLikelihood(build_sensor(scenario.contacts)))
    return build_several(particles, likelihood, scenario.tracker, interval, guided=True)
