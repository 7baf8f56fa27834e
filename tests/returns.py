"""Returns of a small active sonar and of a target that crosses what it hears, with the scenario that tracks it."""

import tomllib
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.data.returns import Returns, from_columns
from faintrack.kinds.returns.build import build_likelihood, build_sonar
from faintrack.kinds.scenario import Scenario
from faintrack.signal.pings import from_pings
from faintrack.simulation.active import capacity_for, draw_ping
from faintrack.targets.states import PlanarState

INTERVAL, PINGS, START = 120.0, 30, 1000.0
"""Seconds from ping to ping; number of pings; time of the first."""
SINCE = INTERVAL * np.arange(PINGS)
VELOCITY = 6.0, -3.0
EAST, NORTH = (first + speed * SINCE for first, speed in zip((-11e3, 9e3), VELOCITY, strict=True))
"""Of the target in every ping; metres."""

SCENARIO = """
[sonar]
pulse = {frequency = 2000.0, duration = 1.0, bandwidth = 10.0}
delay = [3.0, 22.9]
delay_step = 0.1
beams = 24
beam_width_deg = 6.0
source = [0.0, 0.0]
receiver = [500.0, 1000.0]
threshold_db = 9.0
snr_db = 12.0
reach = [5, 4, 0]
swath = [4, 3, 0]

[grid]
x = [-15e3, 15e3]
y = [-15e3, 15e3]
cells = [12, 12]
speed = 9.0
speeds = 3

[target]
arrival_rate = 1e-4
departure_rate = 1e-4
relaxation = 10_000.0
"""


def scenario(**sections: dict[str, Any]) -> Any:
    """The scenario, some fields of its sections replaced."""
    content = tomllib.loads(SCENARIO)
    for name, fields in sections.items():
        content[name] = content.get(name, {}) | fields
    return Scenario(**content)


@cache
def drawn(present: bool = True, seed: int = 0) -> Returns:
    """Returns of all pings, with the target or without."""
    section = scenario().sonar
    sonar = build_sonar(section)
    likelihood = build_likelihood(section, sonar)
    capacity = capacity_for(likelihood)

    def one(key: jax.Array, time: float, east: float, north: float) -> Any:
        state = PlanarState(*(jnp.asarray(each, float) for each in (east, north, *VELOCITY)))
        ping, lost = draw_ping(key, likelihood, capacity, jnp.asarray(time, float), state, jnp.asarray(present))
        assert lost == 0
        return ping

    keys = jax.random.split(jax.random.key(seed), PINGS)
    pings = [one(*each) for each in zip(keys, START + SINCE, EAST, NORTH, strict=True)]
    return from_pings(jax.tree.map(lambda *leaves: jnp.stack(leaves), *pings), sonar)


def columns(pings: int = 3, **more: Any) -> Returns:
    """Returns with one echo from the east in every ping."""
    times = INTERVAL * np.arange(pings)
    known = {name: np.full(pings, value) for name, value in (("delay_s", 8.0), ("bearing_deg", 90.0), ("snr_db", 12.0))}
    return from_columns({"time_s": times, **known, **more})
