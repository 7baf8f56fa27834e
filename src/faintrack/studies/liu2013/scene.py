"""The paper's scene, and what the paper leaves out.

A target is silent for eight seconds, gives a bearing in each of the scans 8 to 32, and is silent again until scan 40,
while an observer at 10 m/s turns twice. Printed are the start of the target, its motion, the error of the bearings, the
number of false ones, that of the particles and the threshold; everything else is chosen once, in `CHOSEN`, and is the
same for all methods.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.sensors.bearing_sets import BearingSensor
from faintrack.targets.births import NormalBirth, RangeBirth
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth, rates


class Chosen(NamedTuple):
    """A parameter that the paper does not print: what it is, its value, its unit."""

    name: str
    value: float
    unit: str


CHOSEN = {
    "birth_probability": Chosen("P_b, of a target that appears, a scan", 0.03, "1"),
    "death_probability": Chosen("P_d, of a target that leaves, a scan", 0.1, "1"),
    "birth_position_m": Chosen("new targets: standard deviation of the position about the start", 50.0, "m"),
    "birth_velocity": Chosen("new targets: standard deviation of the velocity about that at the start", 3.0, "m/s"),
    "sector_deg": Chosen("sector over which false bearings are even", 360.0, "degree"),
    "observer_x_m": Chosen("the observer starts so far to the east", -700.0, "m"),
    "observer_y_m": Chosen("and so far to the north", -400.0, "m"),
    "first_turn_s": Chosen("the observer turns from east to north after", 14.0, "s"),
    "second_turn_s": Chosen("and from north to east after", 26.0, "s"),
    "region_m": Chosen("births over the whole region: within so much of the start, either way", 600.0, "m"),
    "region_speed": Chosen("and with velocities within so much along each axis, either way", 20.0, "m/s"),
    "nearest_m": Chosen("births along bearings: the nearest", 100.0, "m"),
    "farthest_m": Chosen("and the farthest from the observer", 2000.0, "m"),
    "scarce": Chosen("share of particles below which their effective number makes them be drawn anew", 0.5, "1"),
    "births": Chosen("share of newborn among the particles of the Bernoulli filter", 0.2, "1"),
}
"""Unprinted parameters."""

SCANS, INTERVAL = 40, 1.0
FIRST, LAST = 8, 32
"""Scans with a target; numbers from 1."""

START = (380.0, 200.0, 12.25, -12.25)
"""x, y, vx, vy at scan `FIRST`; m and m/s."""

SPEED = 10.0
"""Of the observer; m/s."""

ERROR = math.radians(1.0)
FALSE_PER_SCAN, DETECTION_PROBABILITY = 5.0, 1.0
PARTICLES, DECLARE = 3000, 0.6

DENSITY = 0.1
"""q_s, of the acceleration along each axis; m^2/s^3."""

MOTION = PlanarMotion(math.sqrt(DENSITY))

TIME = INTERVAL * np.arange(1, SCANS + 1)


def present() -> Bool[np.ndarray, " scan"]:
    """Scans in which there is a target: 25 of 40."""
    number = np.arange(1, SCANS + 1)
    return (number >= FIRST) & (number <= LAST)


def observer() -> PlanarState:
    """Where the observer is in every scan: east, north, east again."""
    first, second = CHOSEN["first_turn_s"].value, CHOSEN["second_turn_s"].value
    north = SPEED * (np.clip(TIME, first, second) - first)
    east = SPEED * TIME - north
    turned = north > np.append(0, north[:-1])
    x, y = (CHOSEN[f"observer_{name}_m"].value for name in "xy")
    components = (x + east, y + north, np.where(turned, 0, SPEED), np.where(turned, SPEED, 0))
    return PlanarState(*(jnp.asarray(values, float) for values in components))


def sensor(
    false_per_scan: Float[Array, ""] | float = FALSE_PER_SCAN,
    detection_probability: Float[Array, ""] | float = DETECTION_PROBABILITY,
) -> BearingSensor:
    """What is reported of a scan."""
    width = math.radians(CHOSEN["sector_deg"].value)
    return BearingSensor(ERROR, detection_probability, false_per_scan, -width / 2, width)


def around_start() -> NormalBirth:
    """New targets about the true start."""
    near, slow = CHOSEN["birth_position_m"].value, CHOSEN["birth_velocity"].value
    return NormalBirth(_state(*START), _state(near, near, slow, slow))


def over_region() -> UniformBirth:
    """New targets anywhere in the region."""
    far, fast = CHOSEN["region_m"].value, CHOSEN["region_speed"].value
    x, y = START[:2]
    return UniformBirth(_state(x - far, y - far, -fast, -fast), _state(x + far, y + far, fast, fast))


def along_bearings() -> RangeBirth:
    """New targets at any bearing, about as far from the observer as the region reaches."""
    nearest, farthest = (CHOSEN[f"{end}_m"].value for end in ("nearest", "farthest"))
    return RangeBirth(_state(0, 0, 0, 0), nearest, farthest, CHOSEN["region_speed"].value)


def target(birth: Any) -> Target:
    """What every method believes of a target."""
    appears, leaves = CHOSEN["birth_probability"].value, CHOSEN["death_probability"].value
    return Target(birth, MOTION, *rates(appears, 1 - leaves, INTERVAL))


def path(key: PRNGKeyArray, spread: Float[Array, ""] | float = 0.0) -> PlanarState:
    """True target in every scan, at `START` in the first in which it is heard, with the noise of its motion after.

    With a `spread` of 1 it starts anywhere that the births about the start say.
    """
    for_motion, for_start = jax.random.split(key)
    birth = around_start()
    drawn = jax.tree.map(lambda one, mean: mean + spread * (one[0] - mean), birth.sample(for_start, 1), birth.mean)
    still = PlanarState(*(jnp.zeros(SCANS) for _ in START))
    # What the noise adds from scan to scan, drawn at once: the motion is linear.
    added = MOTION.move(still, jnp.asarray(INTERVAL), for_motion)
    after = jnp.arange(1, SCANS + 1) > FIRST

    def along(start: Array, speed: Array, place: Array, rate: Array) -> tuple[Array, Array]:
        velocity = speed + jnp.cumsum(jnp.where(after, rate, 0))
        before = jnp.concatenate([speed[None], velocity[:-1]])
        return start + jnp.cumsum(jnp.where(after, INTERVAL * before + place, 0)), velocity

    x, vx = along(drawn.x, drawn.vx, added.x, added.vx)
    y, vy = along(drawn.y, drawn.vy, added.y, added.vy)
    return PlanarState(x, y, vx, vy)


def _state(*components: float) -> PlanarState:
    return PlanarState(*(jnp.asarray(value, float) for value in components))
