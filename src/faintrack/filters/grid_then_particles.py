"""A target is sought on a grid and, once found, followed by particles.

On a grid nothing is missed, wherever a target appears; it costs all of its cells for every scan. A target that has been
found is in few of them: particles follow it, between the cells too, and at a fraction of the cost.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.grid import GridFilter
from faintrack.numerics.draws import uniform
from faintrack.numerics.resampling import systematic
from faintrack.targets.target import Target


class GridThenParticles(eqx.Module):
    """The filter of a tracker of many targets (`faintrack.trackers.many.Carrying`).

    Attributes
    ----------
    grid : carries the belief about a target that is not in hand.
    particles : carries those in hand; of the same target.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.beliefs.grids import Grid
    >>> from faintrack.filters.separable import separable
    >>> from faintrack.targets.motion import PlanarMotion
    >>> from faintrack.targets.states import RangeState
    >>> from faintrack.targets.target import Target, UniformBirth
    >>> grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 9)), ("range_rate", Axis(-1.0, 1.0, 3))))
    >>> birth = UniformBirth(RangeState(jnp.array(0.0), jnp.array(-1.0)), RangeState(jnp.array(9.0), jnp.array(1.0)))
    >>> target = Target(birth, PlanarMotion(0.1), 1e-3, 1e-3)
    >>> both = GridThenParticles(GridFilter(grid, target, separable(grid, PlanarMotion(0.1), 1.0)),
    ...                          BernoulliParticleFilter(target, 100))
    >>> key = jax.random.key(0)
    >>> sought = both.init(key)
    >>> near = both.taken(sought, jnp.zeros((9, 3), bool).at[4].set(True), key)
    >>> near.states.range.shape, bool((jnp.abs(near.states.range - 4) <= 0.5).all())
    ((100,), True)
    """

    grid: GridFilter
    particles: BernoulliParticleFilter

    @property
    def target(self) -> Target:
        """What is believed of a target."""
        return self.grid.target

    def init(self, key: PRNGKeyArray, time: float = 0.0, existence: float = 0.0) -> Belief:
        """As `faintrack.filters.grid.GridFilter.init`."""
        return self.grid.init(key, time, existence)

    def predict(self, belief: Belief, time: Float[Array, ""] | float, key: PRNGKeyArray) -> Belief:
        """As `faintrack.filters.grid.GridFilter.predict`."""
        return self.grid.predict(belief, time, key)

    def carry(self, belief: Belief, time: Float[Array, ""], key: PRNGKeyArray) -> tuple[Belief, Float[Array, ""]]:
        """As `faintrack.filters.bernoulli_particle.BernoulliParticleFilter.carry`."""
        return self.particles.carry(belief, time, key)

    def taken(self, belief: Belief, inside: Bool[Array, "*cells"], key: PRNGKeyArray) -> Belief:
        """Particles of a target that has been found, drawn from the cells inside and evenly within each."""
        for_cells, for_places = jax.random.split(key)
        mine = jnp.where(inside, belief.log_weights, -jnp.inf)
        share = jax.nn.logsumexp(mine)
        count, dtype = int(self.particles.particles), belief.log_weights.dtype
        chosen = systematic(for_cells, (mine - share).ravel(), count, count)
        numbers = jnp.unravel_index(chosen, self.grid.grid.shape)
        axes = self.grid.grid.axes
        off = uniform(for_places, (len(axes), count), dtype) - 0.5
        drawn = {
            name: jnp.asarray(axis.values, dtype)[number] + axis.step * part
            for (name, axis), number, part in zip(axes, numbers, off, strict=True)
        }
        kind: Any = self.grid.grid.kind
        nothing = {field.name: jnp.zeros(count, dtype) for field in dataclasses.fields(kind)}
        equal = jnp.full(count, -jnp.log(count), dtype)
        born = jnp.full(count, belief.time, dtype)
        return Belief(kind(**nothing | drawn), equal, belief.log_odds + share, belief.time, born)
