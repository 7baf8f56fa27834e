r"""The background of a sonar's returns, learnt as the data come.

The model's noise is exponential with mean 1 and exceeds the threshold :math:`\eta` in every bin with the probability
:math:`e^{-\eta}`. Reverberation, a normaliser over few cells, a level that is wrong by a decibel make of that another
**rate** :math:`p_k`, and another distribution of the **excess** above the threshold. Only exceedances are known, and so
they are what is learnt: how often, by delay, bearing and Doppler, and how far, over all. The excess follows a
generalised Pareto distribution (Pickands 1975), here that of a power Z with

.. math:: P(Z > z) = \left(1 + \xi z / \lambda\right)^{-1 / \xi}, \qquad
    P(Z > \eta + y \mid Z > \eta) = \left(1 + \frac{\xi y}{\sigma_k}\right)^{-1 / \xi}, \qquad
    \sigma_k = \frac{\xi \eta}{1 - p_k^\xi} ,

in which the level :math:`\lambda` follows from the rate. The **shape** :math:`\xi` is 0 for exponential noise of any
level and 1/N after a normaliser over N cells; it is fitted by what the excesses say of each of `SHAPES`, of those above
`CENSORED` scales only that they are, so that echoes of targets not yet in hand fit no tail. A return is then read as
one with the excess that is as rare in the model's noise,

.. math:: y'_k = \frac{1}{\xi} \log\left(1 + \frac{\xi y_k}{\sigma_k}\right) ,

at the rate of its bin (`faintrack.likelihoods.exceedances`).

**Rates.** A rate is the product of one over all bins and of profiles along delay, bearing and Doppler. A profile is a
tree of halves: of the returns in a stretch its left half has the share of its bins, or with the probability `UNEVEN`
beforehand any other (Kolaczyk 1999); what is expected of that after the counts multiplies down the tree. The rate over
all is the model's, or with the same probability any other. For it all that is remembered counts no more than `LEVEL`
returns beside those of the ping itself, since the level may have changed. Where Doppler is measured reverberation is a
ridge that ends after some delay, and no product of profiles: blocks of delay and Doppler have a factor of their own,
told from 1 by what is remembered alone, with the probability `RIDGE` beforehand.

What is remembered fades over `MEMORY` pings, and what targets in hand account for is not learnt. A target that has not
been found raises the rate of its delays and bearings a little.
"""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from faintrack.sensors.active import ActiveSonar, Ping

SHAPES = np.array([1e-5, 0.005, 0.01, 0.02, 0.03, 0.045, 0.065, 0.09, 0.125, 0.17, 0.23, 0.3, 0.4])
"""Of tails that are told apart; the first is exponential to single precision."""

MEMORY = 50.0
"""Pings that are remembered."""

LEVEL = 20.0
"""Returns of a ping that count as much as all that is remembered of its level."""

UNEVEN = 0.1
"""Probability beforehand that halves of a stretch have different rates."""

VAGUE = 0.1
"""Shape of the density of levels that are any."""

LEAVES = 128
"""Stretches of an axis at most."""

RIDGE = 1e-3
"""Probability beforehand that a block of delay and Doppler has another rate than its profiles."""

BLOCKS = 16
"""Of delay at most, each with every stretch of Doppler."""

COUNTED = 1e4
"""Returns of a stretch at most that its halves are compared by."""

CENSORED = 5.0
"""Scales beyond which an excess counts as no larger."""

LEAST, MOST = 1e-30, 0.5
"""Rates that are told apart from none and from all."""


class Heard(eqx.Module):
    """What is remembered of pings.

    Attributes
    ----------
    pings : number of them.
    returns : in the stretches of delay, bearing and Doppler.
    blocks : returns in blocks of delay and Doppler.
    fits : log likelihood of each shape.
    """

    pings: Float[Array, ""]
    returns: tuple[Float[Array, " delay"], Float[Array, " bearing"], Float[Array, " doppler"]]
    blocks: Float[Array, "block doppler"]
    fits: Float[Array, " shape"]


class Read(eqx.Module):
    """A ping as its background has it.

    Attributes
    ----------
    ping : with rates, and powers that are as rare in the model's noise.
    fits : log likelihood of each shape, by return.
    expected : number of returns.
    shape : of the tail.
    """

    ping: Ping
    fits: Float[Array, "return shape"]
    expected: Float[Array, ""]
    shape: Float[Array, ""]


class ReturnsBackground(eqx.Module):
    """Learns how often bins exceed the threshold without a target, and how far.

    Attributes
    ----------
    sizes : bins in each stretch of delay, bearing and Doppler, over those of the axis.
    shape : of the tail; fitted where None.
    threshold : eta, over the mean power of the model's noise.
    bins : number of the sonar's, along each axis.
    """

    sizes: tuple[Float[Array, " delay"], Float[Array, " bearing"], Float[Array, " doppler"]]
    shape: float | None = eqx.field(static=True)
    threshold: float = eqx.field(static=True)
    bins: tuple[int, int, int] = eqx.field(static=True)

    def init(self) -> Heard:
        """What is remembered before any ping."""
        returns = jax.tree.map(jnp.zeros_like, self.sizes)
        blocks = jnp.zeros((self._blocks, len(self.sizes[2])))
        return Heard(jnp.zeros(()), returns, blocks, jnp.zeros(len(SHAPES)))

    def read(self, heard: Heard, ping: Ping) -> Read:
        """A ping as the background has it that is remembered, and that the ping itself tells.

        Parameters
        ----------
        heard : so far.
        ping : with powers over the mean of the model's noise.
        """
        there = ping.there.astype(ping.power.dtype)
        places = self._places(ping)
        whole = self._level(heard, there.sum())
        profiles = [
            profile(before.at[place].add(there), size)
            for place, before, size in zip(places, heard.returns, self.sizes, strict=True)
        ]
        rate = whole * self._ridge(heard, profiles[0], profiles[2])[self._block(places[0]), places[2]]
        for place, along in zip(places, profiles, strict=True):
            rate = rate * along[place]
        rate = jnp.clip(rate, LEAST, MOST)
        excess = jnp.maximum(ping.power - self.threshold, 0)
        fits = _fits(excess, rate, self.threshold)
        if self.shape is None:
            posterior = jax.nn.softmax(heard.fits + there @ fits)
            shape = posterior @ jnp.asarray(SHAPES, fits.dtype)
        else:
            shape = jnp.asarray(max(self.shape, SHAPES[0]), fits.dtype)
        power = self.threshold + jnp.log1p(shape * excess / scale(rate, shape, self.threshold)) / shape
        told = dataclasses.replace(ping, power=jnp.where(ping.there, power, ping.power), rate=rate)
        return Read(told, fits, whole * math.prod(self.bins), shape)

    def learn(self, heard: Heard, ping: Ping, read: Read, of_targets: Float[Array, " return"]) -> Heard:
        """What is remembered after a ping.

        Parameters
        ----------
        heard : before it.
        ping, read : it, as it is and as the background has it.
        of_targets : probability that each return is an echo of a target in hand.
        """
        kept = 1 - 1 / MEMORY
        weight = jnp.where(ping.there, 1 - of_targets, 0)
        places = self._places(ping)
        returns = jax.tree.map(lambda before, place: (kept * before).at[place].add(weight), heard.returns, places)
        blocks = (kept * heard.blocks).at[self._block(places[0]), places[2]].add(weight)
        return Heard(kept * heard.pings + 1, returns, blocks, kept * heard.fits + weight @ read.fits)

    def _level(self, heard: Heard, count: Float[Array, ""]) -> Float[Array, ""]:
        """Rate over all bins of a ping with a number of returns."""
        alone = math.exp(-self.threshold)
        before = heard.returns[0].sum()
        share = jnp.minimum(1, LEVEL / jnp.maximum(before, 1))
        return alone * level(count + share * before, alone * math.prod(self.bins) * (1 + share * heard.pings))

    @property
    def _blocks(self) -> int:
        """Number of blocks along the delay."""
        return min(BLOCKS, len(self.sizes[0]))

    def _block(self, stretches: Int[Array, " return"]) -> Int[Array, " return"]:
        """Block of delay that a stretch lies in."""
        return stretches * self._blocks // len(self.sizes[0])

    def _ridge(
        self, heard: Heard, delay: Float[Array, " delay"], doppler: Float[Array, " doppler"]
    ) -> Float[Array, "block doppler"]:
        """Rates in blocks of delay and Doppler, over those of the profiles."""
        if len(self.sizes[2]) == 1:
            return jnp.ones_like(heard.blocks)
        shares = (self.sizes[0] * delay).reshape(self._blocks, -1).sum(axis=1)
        expected = heard.blocks.sum() * shares[:, None] * self.sizes[2] * doppler
        return level(heard.blocks, expected, RIDGE)

    def _places(self, ping: Ping) -> tuple[Int[Array, " return"], ...]:
        """Stretches that returns lie in, along each axis."""
        return tuple(
            stretch(ping.bins[..., axis], count, len(size))
            for axis, (count, size) in enumerate(zip(self.bins, self.sizes, strict=True))
        )


def returns_background(sonar: ActiveSonar, threshold: float, shape: float | None = None) -> ReturnsBackground:
    """Background of the returns of a sonar.

    Parameters
    ----------
    sonar : its bins.
    threshold : that returns exceed, over the mean power of the model's noise; linear.
    shape : of the tail; fitted where None.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.sensors.active import Pulse, ping
    >>> sonar = ActiveSonar(Pulse(2350.0, 1.0, 50.0), Axis(4.0, 0.02, 1000), 72, 0.0873, None)
    >>> background = returns_background(sonar, 8.0)
    >>> bins = np.random.default_rng(0).permutation(72_000)[:240]
    >>> bins = np.stack([*np.divmod(bins, 72), np.zeros(240, int)], axis=1)
    >>> read = background.read(background.init(), ping(sonar, 0.0, bins, np.full(240, 9.0), capacity=240))
    >>> round(float(read.expected))
    239
    """
    sizes = []
    for count in sonar.shape:
        leaves = 2 ** math.ceil(math.log2(min(count, LEAVES)))
        sizes.append(
            jnp.asarray(np.bincount(stretch(np.arange(count), count, leaves), minlength=leaves) / count, float)
        )
    return ReturnsBackground((sizes[0], sizes[1], sizes[2]), shape, float(threshold), sonar.shape)


def stretch(number: Any, count: int, leaves: int) -> Any:
    """Number of the stretch that a bin of an axis lies in."""
    return number * leaves // count


def scale(rate: Float[Array, "..."], shape: Float[Array, "..."], threshold: float) -> Float[Array, "..."]:
    """Scale of the excess, sigma of the module's equation.

    Examples
    --------
    >>> alone = jnp.exp(-8.0)
    >>> [round(float(scale(alone, jnp.array(shape), 8.0)), 3) for shape in (1e-5, 0.05)]
    [1.0, 1.213]
    """
    return -shape * threshold / jnp.expm1(shape * jnp.log(rate))


def level(count: Float[Array, "..."], expected: Float[Array, "..."], uneven: float = UNEVEN) -> Float[Array, "..."]:
    r"""Returns over those that are expected.

    Parameters
    ----------
    count : that came.
    expected : of the model's noise.
    uneven : pi, probability beforehand that the factor is not 1.

    Notes
    -----
    With the probability :math:`\pi` the number is Poisson's with any mean, its factor over the expected E
    having a Gamma density of shape and rate a, `VAGUE`; otherwise the factor is 1. The posterior odds of the first are

    .. math:: \frac{\pi}{1 - \pi} \frac{\Gamma(n + a)}{\Gamma(a)} \frac{a^a e^E}{(E + a)^{n + a}}

    and the factor expected then is :math:`(n + a) / (E + a)`.

    Examples
    --------
    >>> [round(float(level(jnp.array(count), jnp.array(38.0))), 2) for count in (0.0, 40.0, 60.0, 200.0)]
    [0.0, 1.0, 1.22, 5.25]
    """
    log_any = jax.scipy.special.gammaln(count + VAGUE) - math.lgamma(VAGUE) + VAGUE * math.log(VAGUE)
    log_odds = log_any - (count + VAGUE) * jnp.log(expected + VAGUE) + expected + math.log(uneven / (1 - uneven))
    return 1 + jax.nn.sigmoid(log_odds) * ((count + VAGUE) / (expected + VAGUE) - 1)


def profile(counts: Float[Array, " leaf"], sizes: Float[Array, " leaf"]) -> Float[Array, " leaf"]:
    r"""Rates along an axis, over the mean of all, from the counts in its stretches.

    Parameters
    ----------
    counts : at least 0; a power of two of them.
    sizes : of the stretches; their sum is 1.

    Notes
    -----
    Of n returns in a stretch m fall into its left half, which has the share s of its bins. With the probability
    :math:`\pi` of `UNEVEN` the share of the returns is any, with a Beta density of the parameters 2 s and 2 (1 - s).
    The posterior odds of that are

    .. math:: \frac{\pi}{1 - \pi}
        \frac{B(m + 2 s, n - m + 2 (1 - s))}{B(2 s, 2 (1 - s))\, s^m (1 - s)^{n - m}}

    and the share expected then is :math:`(m + 2 s) / (n + 2)`.

    Examples
    --------
    >>> even = jnp.full(4, 0.25)
    >>> [round(float(rate), 1) for rate in profile(jnp.array([5.0, 4.0, 6.0, 5.0]), even)]
    [1.0, 1.0, 1.0, 1.0]
    >>> [round(float(rate), 2) for rate in profile(jnp.array([40.0, 40.0, 10.0, 10.0]), even)]
    [1.59, 1.59, 0.41, 0.41]
    """
    levels = [(counts, sizes)]
    while len(levels[-1][0]) > 1:
        levels.append(tuple(part.reshape(-1, 2).sum(axis=1) for part in levels[-1]))  # type: ignore[arg-type]
    rates = jnp.ones(1, counts.dtype)
    for counts_below, sizes_below in reversed(levels[:-1]):
        counted, size = (part.reshape(-1, 2) for part in (counts_below, sizes_below))
        rates = (rates[:, None] * _halves(counted, size)).reshape(-1)
    return rates


def _halves(counted: Float[Array, "stretch 2"], size: Float[Array, "stretch 2"]) -> Float[Array, "stretch 2"]:
    """Rates in the halves of stretches, over that of the whole."""
    whole = (size > 0).all(axis=1, keepdims=True)
    share = jnp.where(whole, size, 1) / jnp.where(whole, size.sum(axis=1, keepdims=True), 2)
    prior = 2 * share
    # The logarithms of single precision tell no more of larger ones.
    counted = counted * jnp.minimum(1, COUNTED / jnp.maximum(counted.sum(axis=1, keepdims=True), 1))
    log_odds = _log_beta(counted + prior) - _log_beta(prior) - jnp.sum(counted * jnp.log(share), axis=1)
    uneven = jax.nn.sigmoid(log_odds + math.log(UNEVEN / (1 - UNEVEN)))[:, None]
    expected = (counted + prior) / (counted.sum(axis=1, keepdims=True) + 2) / share
    return jnp.where(whole, 1 + uneven * (expected - 1), 1)


def _log_beta(parameters: Float[Array, "stretch 2"]) -> Float[Array, " stretch"]:
    gammaln = jax.scipy.special.gammaln
    return gammaln(parameters).sum(axis=1) - gammaln(parameters.sum(axis=1))


def _fits(
    excess: Float[Array, " return"], rate: Float[Array, " return"], threshold: float
) -> Float[Array, "return shape"]:
    """Log likelihood of each of `SHAPES` by each return."""
    shapes = jnp.asarray(SHAPES, excess.dtype)
    wide = scale(rate[:, None], shapes, threshold)
    over = excess[:, None] / wide
    # Of what is censored the probability to lie beyond counts, of the others the density.
    beyond = over > CENSORED
    decay = jnp.log1p(shapes * jnp.minimum(over, CENSORED))
    return -decay / shapes - jnp.where(beyond, 0, decay + jnp.log(wide))
