"""Where new targets appear in the plane: about a place, or at a range from an observer.

`faintrack.targets.target.UniformBirth` spreads them evenly over a box. `NormalBirth` has them about a state, where it
is known from where targets come. `RangeBirth` is what a passive sensor knows of a target that it has just heard:
nothing of the bearing beforehand, of the range that it lies between two ends.
"""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.numerics.draws import normal, uniform
from faintrack.targets.states import PlanarState


class NormalBirth(eqx.Module):
    """New targets about a state, every component normal by itself.

    Attributes
    ----------
    mean, std : states with scalar components.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> birth = NormalBirth(RangeState(jnp.array(900.0), jnp.array(0.0)), RangeState(jnp.array(50.0), jnp.array(3.0)))
    >>> birth.sample(jax.random.key(0), 5).range_rate.shape
    (5,)
    """

    mean: Any
    std: Any

    def sample(self, key: PRNGKeyArray, count: int) -> Any:
        """Draw `count` states; components have the shape (count,) and the type of the mean."""
        mean, treedef = jax.tree.flatten(self.mean)
        std = jax.tree.leaves(self.std)
        draws = normal(key, (len(mean), count), jnp.result_type(*mean))
        return jax.tree.unflatten(treedef, [a + b * u for a, b, u in zip(mean, std, draws, strict=True)])


class RangeBirth(eqx.Module):
    """New targets at any bearing of a sector, their range and velocity uniform.

    Attributes
    ----------
    observer : position about which they lie; scalars.
    nearest, farthest : range; m.
    speed : largest velocity along each axis, either way; m/s.
    start, width : of the sector, anticlockwise from +x; radians.

    Raises
    ------
    InputError : ranges that are not in their order, a speed below 0.

    Examples
    --------
    >>> here = PlanarState(jnp.array(100.0), jnp.array(0.0), jnp.array(0.0), jnp.array(0.0))
    >>> states = RangeBirth(here, 500.0, 600.0, 5.0).sample(jax.random.key(0), 100)
    >>> distance = jnp.hypot(states.x - 100, states.y)
    >>> bool(((distance > 499.9) & (distance < 600.1)).all())
    True
    """

    observer: PlanarState
    nearest: float
    farthest: float
    speed: float
    start: float = -math.pi
    width: float = 2 * math.pi

    def __check_init__(self) -> None:
        if not (0 <= self.nearest < self.farthest < math.inf and 0 <= self.speed < math.inf):
            raise InputError(
                f"births at a range: nearest {self.nearest:g} m, farthest {self.farthest:g} m, "
                f"speed {self.speed:g} m/s; expected the nearest first, and a speed of 0 or more."
            )

    def sample(self, key: PRNGKeyArray, count: int) -> PlanarState:
        """Draw `count` states; components have the shape (count,)."""
        dtype = jnp.result_type(self.observer.x)
        bearing, distance, vx, vy = uniform(key, (4, count), dtype)
        bearing = self.start + self.width * bearing
        distance = self.nearest + (self.farthest - self.nearest) * distance
        return PlanarState(
            self.observer.x + distance * jnp.cos(bearing),
            self.observer.y + distance * jnp.sin(bearing),
            self.speed * (2 * vx - 1),
            self.speed * (2 * vy - 1),
        )

    def turned_to(self, states: PlanarState, observer: PlanarState, bearing: Float[Array, " count"]) -> PlanarState:
        """States with their range and velocity, at given bearings from another observer."""
        distance = jnp.hypot(states.x - self.observer.x, states.y - self.observer.y)
        x, y = observer.x + distance * jnp.cos(bearing), observer.y + distance * jnp.sin(bearing)
        return PlanarState(x, y, states.vx, states.vy)
