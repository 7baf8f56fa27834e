"""Where new targets appear in the plane: about a place, or at a range from an observer.

`faintrack.targets.target.UniformBirth` spreads them evenly over a box. `NormalBirth` has them about a state, where it
is known from where targets come, `PlanarBirth` about any of several, with a density by the place. `RangeBirth` is what
a passive sensor knows of a target that it has just heard: nothing of the bearing beforehand, of the range that it lies
between two ends.
"""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

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


class PlanarBirth(eqx.Module):
    """New targets about any of several states in the plane, all as likely, every component normal by itself.

    Attributes
    ----------
    mean, std : states with components of shape (site,).

    Examples
    --------
    >>> sites = PlanarState(jnp.array([0.0, 50.0]), *(jnp.zeros(2),) * 3)
    >>> birth = PlanarBirth(sites, PlanarState(*(jnp.ones(2),) * 4))
    >>> birth.sample(jax.random.key(0), 5).vx.shape
    (5,)
    >>> round(float(jnp.exp(birth.log_density(jnp.array(50.0), jnp.array(0.0)))), 4)  # 1 / 2 of 1 / (2 pi)
    0.0796
    """

    mean: PlanarState
    std: PlanarState

    def sample(self, key: PRNGKeyArray, count: int) -> PlanarState:
        """Draw `count` states; components have the shape (count,)."""
        for_site, for_state = jax.random.split(key)
        sites = self.mean.x.size
        return self._about(for_state, jax.random.randint(for_site, (count,), 0, sites))

    def log_density(self, x: Float[Array, "*places"], y: Float[Array, "*places"]) -> Float[Array, "*places"]:
        """Natural log of the density of new targets at places, whatever their velocity; 1/m^2."""
        return jax.nn.logsumexp(self._by_site(x, y), axis=-1)

    def sample_at(self, key: PRNGKeyArray, x: Float[Array, " count"], y: Float[Array, " count"]) -> PlanarState:
        """Draw the velocities of new targets at places."""
        for_site, for_state = jax.random.split(key)
        site = jax.random.categorical(for_site, self._by_site(x, y))
        return dataclasses.replace(self._about(for_state, site), x=x, y=y)

    def _about(self, key: PRNGKeyArray, site: Int[Array, " count"]) -> PlanarState:
        mean, std = (jax.tree.map(lambda component: component[site], states) for states in (self.mean, self.std))
        draws = normal(key, (4, site.size), mean.x.dtype)
        return jax.tree.map(lambda a, b, u: a + b * u, mean, std, PlanarState(*draws))

    def _by_site(self, x: Float[Array, "*places"], y: Float[Array, "*places"]) -> Float[Array, "*places site"]:
        """Log of each site's part of the density of places."""
        off = (x[..., None] - self.mean.x) / self.std.x, (y[..., None] - self.mean.y) / self.std.y
        area = 2 * jnp.pi * self.std.x * self.std.y * self.mean.x.size
        return -(off[0] ** 2 + off[1] ** 2) / 2 - jnp.log(area)


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
