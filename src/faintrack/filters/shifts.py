r"""Motion on a grid of discrete velocities: whole cells, moved exactly.

A cell of rate v moves by as many cells as its straight path passes between two times, and by a random number of cells
more in every step (plant noise; stone2002, eq. 30-31):

.. math::
    i(t') = i(t) + \left[\frac{v t'}{\Delta}\right] - \left[\frac{v t}{\Delta}\right] + \delta,
    \qquad P(\delta = d) = p_d

with [ ] rounding to the nearest whole number. Paths of slow targets (stone2002, 4.2: a fifteenth of a cell in a scan)
so stay within half a cell of straight ones for ever, where moving a share of the weight would smear them over the
grid. Weights are added in logarithms: nothing underflows.

Use it for targets that keep their velocity while they can be seen, and for the papers' discrete models. Where
velocities change, use `faintrack.filters.separable`.
"""

import math
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError


class Shifts(eqx.Module):
    """Shift of every velocity's cells, and plant noise.

    Attributes
    ----------
    grid : cells; the rate of a component that moves is an axis too.
    interval : of one step, to which the plant noise belongs; seconds.
    plant : probabilities of moving by -d to d cells more, an odd number of them; the same along every component.
    join : what becomes of paths that meet: their logs are summed over an axis. `jax.numpy.max` keeps the likeliest
        (`faintrack.baselines.viterbi`).

    Raises
    ------
    InputError : plant noise that is no symmetric range of probabilities.
    """

    grid: Grid = eqx.field(static=True)
    interval: float = eqx.field(static=True)
    plant: tuple[float, ...] = eqx.field(static=True, default=(1.0,))
    join: Callable[..., Array] = eqx.field(static=True, default=jax.nn.logsumexp)

    def __check_init__(self) -> None:
        if len(self.plant) % 2 == 0 or min(self.plant) < 0 or abs(sum(self.plant) - 1) > 1e-6:
            raise InputError(f"plant is {self.plant}; expected an odd number of probabilities that sum to 1.")

    def carry(
        self, log_weights: Float[Array, "*cells"], start: Array, end: Array, key: PRNGKeyArray
    ) -> tuple[Float[Array, "*cells"], Float[Array, ""]]:
        """Weights at `end` and what has left the grid (the module's equation); `key` is not used."""

        def again(number: Array, carried: tuple[Array, Array]) -> tuple[Array, Array]:
            log_weights, log_lost = carried
            log_weights, more = self._advance(log_weights, start + number * self.interval)
            return log_weights, jnp.logaddexp(log_lost, more)

        count = jnp.round((end - start) / self.interval).astype(jnp.int32)
        return jax.lax.fori_loop(0, count, again, (log_weights, jnp.array(-jnp.inf, log_weights.dtype)))

    def _advance(self, log_weights: Float[Array, "*cells"], start: Array) -> tuple[Array, Array]:
        log_lost = jnp.array(-jnp.inf, log_weights.dtype)
        for place, rate in self.grid.pairs:
            axis, velocity = self.grid.axes[place][1], self.grid.axes[rate][1]
            cells = jnp.asarray(velocity.values / axis.step, log_weights.dtype)
            shift = (jnp.round(cells * (start + self.interval)) - jnp.round(cells * start)).astype(jnp.int32)
            front = jnp.moveaxis(log_weights, (rate, place), (0, 1))
            summed = jax.nn.logsumexp(front, axis=tuple(range(2, front.ndim)))
            log_lost = jnp.logaddexp(log_lost, jax.nn.logsumexp(summed + self._log_leaving(shift, axis.count)))
            log_weights = jnp.moveaxis(jax.vmap(self._shifted)(front, shift), (0, 1), (rate, place))
        return log_weights, log_lost

    def _shifted(self, values: Float[Array, "place *rest"], shift: Int[Array, ""]) -> Float[Array, "place *rest"]:
        """Weights of one velocity moved along the first axis."""
        count, reach = values.shape[0], len(self.plant) // 2
        # Places beyond the ends too, from which plant noise may come back.
        origin = jnp.arange(-reach, count + reach) - shift
        inside = ((origin >= 0) & (origin < count)).reshape(-1, *[1] * (values.ndim - 1))
        moved = jnp.where(inside, values[jnp.clip(origin, 0, count - 1)], -jnp.inf)
        if reach == 0:
            return moved
        parts = [
            moved[2 * reach - number : 2 * reach - number + count] + math.log(probability)
            for number, probability in enumerate(self.plant)
            if probability > 0
        ]
        return self.join(jnp.stack(parts), axis=0)

    def _log_leaving(self, shift: Int[Array, " rate"], count: int) -> Float[Array, "rate place"]:
        """Log of the probability of ending off the grid from every cell."""
        reach = len(self.plant) // 2
        arrival = jnp.arange(count)[:, None] + shift[:, None, None] + jnp.arange(-reach, reach + 1)
        off = (arrival < 0) | (arrival >= count)
        return jnp.log(jnp.sum(jnp.where(off, jnp.array(self.plant), 0), axis=-1))
