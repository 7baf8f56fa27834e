r"""Returns of an active sonar: bins whose power exceeded a threshold, and all those that did not.

The power of every bin is exponential, with mean 1 without a target and :math:`\mu_k = 1 + s\, h_k` with one
(`faintrack.sensors.active`). Only bins above the threshold :math:`\eta` are reported, with their power; of the others
it is known that they lie below. With :math:`\mathbf k` the bins that are reported (aughenbaugh2010, eq. 25-29),

.. math::
    \log \ell(y | x) = \sum_{k} \log \frac{1 - e^{-\eta / \mu_k}}{1 - e^{-\eta}}
    + \sum_{k \in \mathbf k} \left[ -\log \mu_k + z_k \left(1 - \frac{1}{\mu_k}\right)
    - \log \frac{1 - e^{-\eta / \mu_k}}{1 - e^{-\eta}} \right] .

Only bins that the target reaches have a term. The first sum does not depend on the returns: it repeats from bin to bin,
but for bins near the ends, and is tabulated over the place within a bin.

**Another background** exceeds the threshold with the probability :math:`p_k` of the bin in place of
:math:`p = e^{-\eta}`, and its powers are told as those that the same excess would have in exponential noise. A target
lowers the probability of a quiet bin by the same factor :math:`e^{q_k}`, the first sum's, in every background, and
scales the excess by :math:`\mu_k`. The bracket then gains

.. math:: \log \frac{1 - (1 - p_k) e^{q_k}}{p_k} - \log \frac{1 - (1 - p) e^{q_k}}{p} ,

and the mean ratio under the background is 1 as before.

**Fading of a ping.** As published every bin draws the echo's amplitude for itself. But an echo has one amplitude in a
ping, which all bins that it reaches share: where it fades they fall silent together, and taken one by one, a dozen bins
of overlapping beams count one fade as a dozen. With :math:`g` the power of the amplitude over its mean, exponential of
mean 1, the ratio is

.. math:: \ell(y | x) = \mathrm{E}_g \, \ell(y | x, s g) \approx \sum_i w_i \, \ell(y | x, s g_i) ,

the sum being over classes of g, `FADES`, each with its probability and its mean. Given g a bin's power is taken as
exponential as before, which is wider than that of a constant amplitude in noise: a response that is not quite the
model's costs little.
"""

import functools
import itertools
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.sensors.active import ActiveSonar, Ping
from faintrack.sensors.active_draws import draw_returns

NODES = 8
"""Places within a bin at which the sum over quiet bins is tabulated; straight lines in between."""

BLOCK = 1024
"""States near a return that are taken at a time."""

Real = Float[Array, "..."]

Fades = tuple[tuple[float, float], ...]
"""Power of an amplitude over its mean, and the probability of it; powers have the mean 1."""


def fades(edges: tuple[float, ...]) -> Fades:
    """Mean and probability of the classes of an exponential number of mean 1.

    Parameters
    ----------
    edges : between the classes, ascending and above 0.

    Examples
    --------
    >>> [[round(number, 3) for number in one] for one in fades((math.log(2),))]
    [[0.307, 0.5], [1.693, 0.5]]
    """
    beyond = [1.0, *(math.exp(-edge) for edge in edges), 0.0]
    # Of the mean, what lies beyond an edge.
    means = [1.0, *((1 + edge) * math.exp(-edge) for edge in edges), 0.0]
    return tuple(
        ((means[i] - means[i + 1]) / (beyond[i] - beyond[i + 1]), beyond[i] - beyond[i + 1])
        for i in range(len(edges) + 1)
    )


STEADY: Fades = ((1.0, 1.0),)
"""The bins of an echo fade each for itself."""

FADES = fades(tuple(10 ** (edge_db / 10) for edge_db in (-17.5, -12.5, -7.5, -2.5, 2.5)))
"""The bins of an echo fade together, in classes 5 dB wide."""


class ExceedanceLikelihood(eqx.Module):
    """Log ratio of the returns of one ping.

    Attributes
    ----------
    sonar : bins and response.
    snr : mean power of a target's echo over that of the noise, s; linear.
    threshold : eta, over the mean power of the noise; linear.
    quiet : the sum over quiet bins by class of fading, class of delay, place in the delay bin and in the beam, class of
        Doppler, place in the Doppler bin.
    fading : classes of the power that the bins of an echo share in a ping; `STEADY` or `FADES`.

    Raises
    ------
    InputError : a threshold that is not above 0, or an SNR below 0.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.sensors.active import Pulse, ping
    >>> from faintrack.sensors.bistatic import Bistatic, fixed
    >>> pair = Bistatic(fixed(0.0, 0.0), fixed(0.0, 0.0))
    >>> sonar = ActiveSonar(Pulse(2000.0, 1.0), Axis(4.0, 0.5, 40), 72, 0.0873, Axis(-30.0, 0.5, 121), pair)
    >>> likelihood = ExceedanceLikelihood(sonar, snr=9.0, threshold=8.0)
    >>> heard = ping(sonar, 0.0, np.array([[16, 0, 60]]), np.array([20.0]), capacity=4)
    >>> states = fixed(9000.0, 0.0), fixed(0.0, 9000.0)
    >>> [round(float(likelihood.log_ratio(heard, state)), 1) for state in states]
    [12.8, -3.5]
    """

    sonar: ActiveSonar
    snr: Float[Array, ""]
    threshold: float = eqx.field(static=True)
    quiet: Float[Array, "fade _ _ _ _ _"]
    fading: Fades = eqx.field(static=True)

    def __init__(self, sonar: ActiveSonar, snr: float, threshold: float, fading: Fades = STEADY) -> None:
        if not threshold > 0 or not snr >= 0:
            raise InputError(
                f"exceedances: threshold is {threshold:g} and SNR {snr:g}; expected above 0, and at least 0 (linear)."
            )
        self.sonar = sonar
        self.snr = jnp.asarray(snr, float)
        self.threshold = float(threshold)
        self.fading = fading
        self.quiet = quiet_tables(self, (NODES, NODES, NODES))

    @eqx.filter_jit
    def log_ratio(self, ping: Ping, states: Any) -> Real:
        """Natural log of p(returns | target at state) / p(returns | no target); 0 where it cannot be heard.

        Parameters
        ----------
        ping : returns of one ping.
        states : position and, where Doppler is measured, velocity; broadcast against each other.
        """
        place = jnp.broadcast_arrays(*self.sonar.place(self.sonar.geometry(ping), states))
        arrays, others = eqx.partition(self, eqx.is_array)

        # Side by side, runs would wait for the one with the most states near returns, and pass over no return.
        @jax.custom_batching.sequential_vmap
        def told(arrays: ExceedanceLikelihood, ping: Ping, place: Float[Array, "3 state"]) -> Float[Array, " state"]:
            return eqx.combine(arrays, others)._faded(ping, place)

        return told(arrays, ping, jnp.stack([each.ravel() for each in place])).reshape(place[0].shape)

    def simulate(self, ping: Ping, states: Any, present: Bool[Array, ""] | bool, key: PRNGKeyArray) -> Ping:
        """Returns drawn from the module's model; those that find no entry, at the longest delays, are left out.

        Parameters
        ----------
        ping : time, source and receiver, and number of entries (`faintrack.simulation.active.capacity_for`).
        states : of a target; scalars.
        present : whether it is there.
        key : random key.
        """
        for_fade, for_returns = (key, key) if self.fading == STEADY else jax.random.split(key)
        return draw_returns(
            for_returns, self.sonar, self.drawn_snr(for_fade, ()), self.threshold, ping, states, present
        )[0]

    def drawn_snr(self, key: PRNGKeyArray, shape: tuple[int, ...]) -> Real:
        """SNR of echoes in one ping; the mean where their bins fade each for itself."""
        if self.fading == STEADY:
            return self.snr
        powers, chances = jnp.asarray(self.fading, self.snr.dtype).T
        return self.snr * jax.random.choice(key, powers, shape, p=chances)

    def told(self, response: Real, power: Real, rate: Real | None = None) -> Real:
        """What a return adds for a target with this response in its bin: the bracket of the module's equation."""
        mean = 1 + self.snr * response
        quiet = quiet_bin(mean, self.threshold)
        told = power * (1 - 1 / mean) - jnp.log(mean) - quiet
        return told if rate is None else told + rated(quiet, mean, rate, self.threshold)

    def _quiet_at(self, delay: Real, beam: Real, shift: Real) -> Real:
        """The sum over quiet bins, from the table by straight lines."""
        sonar, nodes = self.sonar, [self.quiet.shape[axis] - 1 for axis in (2, 3, 5)]
        of_delay, of_shift = (
            edge_class(jnp.floor(place), sonar.shape[axis], sonar.reach[axis]).astype(jnp.int32)
            for axis, place in ((0, delay), (2, shift))
        )
        ends = [_between_nodes(place, count) for place, count in zip((delay, beam, shift), nodes, strict=True)]
        parts = (
            share_a * share_b * share_c * self.quiet[0, of_delay, a, b, of_shift, c]
            for (a, share_a), (b, share_b), (c, share_c) in itertools.product(*ends)
        )
        return functools.reduce(jnp.add, parts)

    def _faded(self, ping: Ping, place: Float[Array, "3 state"]) -> Float[Array, " state"]:
        """Log ratio at bin numbers: the mean over the classes of fading."""
        if len(self.fading) == 1:
            return self._at(ping, place)
        powers, chances = jnp.asarray(self.fading, self.snr.dtype).T

        def told(one: tuple[Array, Array]) -> Float[Array, " state"]:
            snr, quiet = one
            return eqx.tree_at(lambda whole: (whole.snr, whole.quiet), self, (snr, quiet[None]))._at(ping, place)

        every = jax.lax.map(told, (self.snr * powers, self.quiet))
        return jax.nn.logsumexp(every + jnp.log(chances)[:, None], axis=0)

    def _at(self, ping: Ping, place: Float[Array, "3 state"]) -> Float[Array, " state"]:
        """Log ratio at bin numbers: of the quiet bins, and where a return is near what it adds, a block at a time."""
        # What a branch reads is in memory; otherwise XLA would work the places out anew for everything that reads them.
        return jax.lax.cond(
            ping.there.any(),
            lambda place: self._with_returns(ping, place),
            lambda place: self._without_returns(place),
            place,
        )

    def _without_returns(self, place: Float[Array, "3 state"]) -> Float[Array, " state"]:
        return jnp.where(self.sonar.heard(place[0], place[2]), self._quiet_at(*place), 0)

    def _with_returns(self, ping: Ping, place: Float[Array, "3 state"]) -> Float[Array, " state"]:
        heard = self.sonar.heard(place[0], place[2])
        before = jnp.floor(place).astype(jnp.int32)
        close = heard & self._reached(ping)[before[0] + 1, before[1] % self.sonar.beams, before[2] + 1]
        at_once = min(BLOCK, close.size)
        order = _numbers(close, close.size + at_once)

        def take_in(block: Int[Array, ""], total: Array) -> Array:
            index = jax.lax.dynamic_slice(order, (block * at_once,), (at_once,))
            here = place[:, jnp.minimum(index, close.size - 1)]
            return total.at[index].add(self._all_told(ping, *here), mode="drop")

        blocks = -(-close.sum() // at_once)
        return jax.lax.fori_loop(0, blocks, take_in, self._without_returns(place))

    def _reached(self, ping: Ping) -> Bool[Array, "delay beam shift"]:
        """Whether a return is within reach between a bin and the next; delay and Doppler begin before the first bin."""
        sonar = self.sonar
        counts = sonar.shape[0] + 1, sonar.beams, sonar.shape[2] + 1
        delay, beam, shift = (
            ping.bins[:, axis, None] + np.arange(-reach, reach + 1) for axis, reach in enumerate(sonar.reach)
        )
        # What is outside gets a number that is dropped; a negative one would count from the end.
        delay = jnp.where(ping.there[:, None] & (delay >= -1), delay + 1, counts[0])
        shift = jnp.where(shift >= -1, shift + 1, counts[2])
        window = delay[:, :, None, None], beam[:, None, :, None] % sonar.beams, shift[:, None, None, :]
        return jnp.zeros(counts, bool).at[window].set(True, mode="drop")

    def _all_told(self, ping: Ping, delay: Real, beam: Real, shift: Real) -> Real:
        """Sum of what returns tell, one by one; those in reach of no state are passed over."""
        sonar = self.sonar
        delays = jnp.where(ping.there, ping.bins[:, 0], jnp.iinfo(jnp.int32).max // 2)
        ends = jnp.stack([jnp.ceil(delay.min() - sonar.reach[0]), jnp.floor(delay.max() + sonar.reach[0]) + 1])
        first, last = jnp.searchsorted(delays, ends.astype(jnp.int32))

        def one(number: Int[Array, ""], total: Array) -> Array:
            place, power = ping.bins[number], ping.power[number]
            rate = None if ping.rate is None else ping.rate[number]
            around = beam - place[1]
            off = delay - place[0], around - sonar.beams * jnp.round(around / sonar.beams), shift - place[2]
            near = jnp.stack([jnp.abs(each) <= reach for each, reach in zip(off, sonar.reach, strict=True)]).all(axis=0)
            return jax.lax.cond(
                near.any(),
                lambda: total + jnp.where(near, self.told(sonar.response(*off), power, rate), 0),
                lambda: total,
            )

        return jax.lax.fori_loop(first, last, one, jnp.zeros_like(delay))


def _between_nodes(place: Real, nodes: int) -> list[tuple[Int[Array, "..."], Real]]:
    """Nodes on either side of a place within its bin, each with its share; of none there is one place."""
    fine = (place - jnp.floor(place)) * nodes
    low = jnp.clip(jnp.floor(fine), 0, max(nodes - 1, 0))
    number, share = low.astype(jnp.int32), fine - low
    return [(number, 1 - share), (number + 1, share)] if nodes else [(number, jnp.ones_like(place))]


def _numbers(which: Bool[Array, " state"], size: int) -> Int[Array, " size"]:
    """Numbers of those that are true, then the count of all: `jax.numpy.nonzero` with half of its sums."""
    place = jnp.where(which, jnp.cumsum(which) - 1, size)
    return jnp.full(size, which.size).at[place].set(jnp.arange(which.size), mode="drop", unique_indices=True)


def quiet_bin(mean: Any, threshold: float) -> Any:
    """Log of the probability that a bin stays below the threshold, over that without a target."""
    numbers = jnp if isinstance(mean, jax.Array) else np
    return numbers.log1p(-numbers.exp(-threshold / mean)) - np.log1p(-np.exp(-threshold))


def rated(quiet: Real, mean: Real, rate: Real, threshold: float) -> Real:
    """What a return tells beyond its power where the background has another rate: the module's last equation.

    Parameters
    ----------
    quiet : `quiet_bin` of the bin.
    mean : of its power with the target.
    rate : probability that the background exceeds the threshold in the bin.
    threshold : eta.

    Examples
    --------
    >>> mean = jnp.array([1.0, 17.0])
    >>> [round(float(one), 3) for one in rated(quiet_bin(mean, 8.0), mean, jnp.array(10 * np.exp(-8.0)), 8.0)]
    [0.0, -2.301]
    """
    return jnp.log(rate * jnp.exp(quiet) - jnp.expm1(quiet)) - jnp.log(rate) - threshold * (1 - 1 / mean)


def edge_class(whole: Any, count: int, reach: int) -> Any:
    """Class of a whole bin number from -1 to `count` - 1: which of the bins within reach exist.

    Examples
    --------
    >>> edge_class(np.array([-1, 0, 1, 2, 50, 97, 98, 99]), 100, 1).tolist()
    [0, 1, 2, 2, 2, 2, 3, 4]
    """
    numbers = jnp if isinstance(whole, jax.Array) else np
    if count <= 2 * reach + 2:
        return whole + 1
    return numbers.clip(whole + 1, 0, reach + 1) + numbers.clip(whole - (count - 2 - reach), 0, reach + 1)


def quiet_table(
    sonar: ActiveSonar, snr: float, threshold: float, nodes: tuple[int, int, int]
) -> Float[Array, "_ _ _ _ _"]:
    """Sum over quiet bins by class of delay, place in the delay bin and the beam, class and place of Doppler.

    Parameters
    ----------
    sonar, snr, threshold : as of the likelihood.
    nodes : places told apart in a bin of delay, bearing, Doppler; the table has one more, the next bin's first. Without
        Doppler it has one place there.
    """
    reach = sonar.reach
    nodes = (*nodes[:2], 0) if sonar.doppler is None else nodes
    places = [np.arange(count + 1) / max(count, 1) for count in nodes]
    steps = [np.arange(-r, r + 2) for r in reach]
    off = [step - place[:, None] for step, place in zip(steps, places, strict=True)]
    response = sonar.tabled(
        off[0][:, :, None, None, None, None], off[1][None, None, :, :, None, None], off[2][None, None, None, None]
    )
    told = quiet_bin(1 + snr * response, threshold).sum(axis=3)
    exists = [_existing(sonar.shape[axis], reach[axis], steps[axis]) for axis in (0, 2)]
    return jnp.asarray(np.einsum("co,fobgp,ep->cfbeg", exists[0], told, exists[1], optimize=True), float)


def quiet_tables(likelihood: ExceedanceLikelihood, nodes: tuple[int, int, int]) -> Float[Array, "fade _ _ _ _ _"]:
    """`quiet_table` of every class of fading."""
    sonar, snr, threshold = likelihood.sonar, float(likelihood.snr), likelihood.threshold
    return jnp.stack([quiet_table(sonar, snr * power, threshold, nodes) for power, _ in likelihood.fading])


def _existing(count: int, reach: int, steps: np.ndarray) -> Float[np.ndarray, "class step"]:
    """Whether the bin a step away exists, for every class of whole bin numbers."""
    whole = np.arange(-1, count)
    classes = edge_class(whole, count, reach)
    _, first = np.unique(classes, return_index=True)
    bins = whole[first][:, None] + steps
    return ((bins >= 0) & (bins < count)).astype(float)
