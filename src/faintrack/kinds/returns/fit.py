r"""Whether the returns of pings without a track look like those of the background: what results tell of it.

Under the background :math:`e^{-y}` of the excess of a return, as the likelihood reads it, is uniform, and a ping has as
many returns as are expected. Ranks in tenths and the number of returns show where it is not so.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from faintrack.kinds.returns.build import PairReturns
from faintrack.sensors.active import Ping
from faintrack.sensors.multistatic import Pings
from faintrack.signal.lone_returns import Neighbours, neighbours

RANKS = 10
"""In which the excess of returns is told."""

OFF = 0.25
"""Of a tenth, or of the number of returns: how far from what is expected is told."""

DEVIATIONS = 5.0
"""Standard deviations that chance is allowed."""

FEWEST, LONE = 20, 0.2
"""Loud returns that tell anything; share of the neighbours expected of them below which they look like contacts."""


class Fit(NamedTuple):
    """Of a ping, or a stack of them.

    Attributes
    ----------
    ranks : number of returns by tenth of the rank of their excess, the loudest first.
    expected : returns, without a target.
    shape : of the tail.
    """

    ranks: Float[Array, "*ping rank"]
    expected: Float[Array, "*ping"]
    shape: Float[Array, "*ping"]


def fit_of(
    ping: Ping, threshold: float, expected: Float[Array, ""] | float = jnp.nan, shape: Float[Array, ""] | float = 0.0
) -> Fit:
    """Fit of a ping, as the likelihood reads it."""
    rank = jnp.exp(-jnp.maximum(ping.power - threshold, 0))
    tenth = jnp.minimum((rank * RANKS).astype(jnp.int32), RANKS - 1)
    ranks = jnp.zeros(RANKS).at[tenth].add(ping.there.astype(float))
    return Fit(ranks, jnp.asarray(expected, float), jnp.asarray(shape, float))


def fit_of_scan(scan: Ping | Pings, thresholds: tuple[float, ...], expected: Any = jnp.nan, shape: Any = 0.0) -> Fit:
    """Fit of a ping; that of several pairs is stacked.

    Parameters
    ----------
    scan : as the likelihood reads it.
    thresholds : of each pair.
    expected, shape : of the background, of each pair.
    """
    if isinstance(scan, Ping):
        return fit_of(scan, thresholds[0], expected, shape)
    count = len(scan.pings)
    expected, shape = (jnp.broadcast_to(jnp.asarray(each, float), (count,)) for each in (expected, shape))
    fits = [fit_of(ping, thresholds[number], expected[number], shape[number]) for number, ping in enumerate(scan.pings)]
    return Fit(*(jnp.stack(each) for each in zip(*fits, strict=True)))


class FitOfPings:
    """Fit of all pings without a track, added up as they come.

    Parameters
    ----------
    bins : of the sonar.
    threshold : over the mean power of the model's noise; linear.
    learnt : whether the background is learnt; otherwise it is the model's.
    """

    def __init__(self, bins: int, threshold: float, learnt: bool) -> None:
        self._modelled, self._learnt = bins * float(np.exp(-threshold)), learnt
        self._threshold, self._bins = threshold, bins
        self._pings, self._returns, self._shape = 0, 0, 0.0
        self._ranks = np.zeros(RANKS)

    def add(self, fits: Any, counts: Int[np.ndarray, " ping"], tracked: Bool[np.ndarray, " ping"]) -> None:
        """Add some pings.

        Parameters
        ----------
        fits : `Fit` of them.
        counts : number of their returns.
        tracked : whether there is a track.
        """
        alone = ~np.asarray(tracked)
        self._pings += int(alone.sum())
        self._returns += int(np.asarray(counts)[alone].sum())
        self._ranks += np.asarray(fits.ranks)[alone].sum(axis=0)
        self._shape = float(np.asarray(fits.shape)[-1])

    def remarks(self) -> tuple[str, ...]:
        """What was learnt; one sentence each."""
        return self._of_rate() if self._learnt else ()

    def misfits(self) -> tuple[str, ...]:
        """Why existence may be wrong; one sentence each."""
        if not self._returns:
            return ()
        share = self._ranks[0] / self._returns
        deviation = np.sqrt(0.1 * 0.9 / self._returns)
        off = abs(share - 0.1) > max(OFF * 0.1, DEVIATIONS * deviation)
        return (*(() if self._learnt else self._of_rate()), *((self._of_excess(share),) if off else ()))

    def _of_rate(self) -> tuple[str, ...]:
        expected = self._modelled * self._pings
        if not self._returns or abs(self._returns - expected) <= max(OFF * expected, DEVIATIONS * np.sqrt(expected)):
            return ()
        level = self._threshold / -np.log(min(self._returns / self._pings / self._bins, 0.5))
        tail = f" with a tail of shape {self._shape:.2g}" if self._learnt and self._shape >= 0.01 else ""
        then = "it was learnt" if self._learnt else "existence may be wrong, expected background.learn"
        return (
            f"Pings without a track have {self._returns / self._pings:.4g} returns, where noise of mean 1 gives "
            f"{expected / self._pings:.4g}: as if it were {10 * np.log10(level):+.2g} dB{tail}. A level that is not 1, "
            f"reverberation, clutter or a normaliser make that; {then}.",
        )

    def _of_excess(self, share: float) -> str:
        side = "more" if share > 0.1 else "fewer"
        return (
            f"Of the returns of pings without a track {100 * share:.3g} % are as loud as the loudest tenth of the "
            f"background, {side} than fit: existence may be wrong. Expected noise that is normalised alike everywhere, "
            "a higher sonar.threshold_db, or another background.shape."
        )


class FitOfPairs:
    """Fit of all pings without a track, of each pair of a source and a receiver.

    Parameters
    ----------
    parts : what each pair heard.
    learnt : whether the background is learnt.
    """

    def __init__(self, parts: Sequence[PairReturns], learnt: bool) -> None:
        self._parts = parts
        self._fits = [FitOfPings(part.binned.sonar.size, part.threshold, learnt) for part in parts]

    def add(
        self,
        fits: Any,
        numbers: Int[np.ndarray, " ping"],
        reported: Bool[np.ndarray, "ping pair"],
        tracked: Bool[np.ndarray, " ping"],
    ) -> None:
        """Add some pings.

        Parameters
        ----------
        fits : `Fit` of them, of several pairs stacked.
        numbers : of the pings.
        reported : whether each pair reported.
        tracked : whether there is a track.
        """
        for number, (part, fit) in enumerate(zip(self._parts, self._fits, strict=True)):
            mine = fits if len(self._parts) == 1 else jax.tree.map(lambda each, number=number: each[:, number], fits)
            fit.add(mine, part.binned.returns.counts[numbers], tracked | ~reported[:, number])

    def remarks(self) -> tuple[str, ...]:
        """What was learnt, by pair; one sentence each."""
        pairs = zip(self._parts, self._fits, strict=True)
        return tuple(_of_pair(part, remark) for part, fit in pairs for remark in fit.remarks())

    def misfits(self) -> tuple[str, ...]:
        """Why existence may be wrong, by pair; one sentence each."""
        pairs = zip(self._parts, self._fits, strict=True)
        return tuple(_of_pair(part, misfit) for part, fit in pairs for misfit in fit.misfits())


def about_pairs(parts: Sequence[PairReturns], recognised: bool) -> tuple[str, ...]:
    """That bins of pairs are not all read, or look like contacts; one sentence each."""
    return tuple(
        _of_pair(part, remark)
        for part in parts
        for remark in (*about_bins(part.every, recognised), *about_contacts(neighbours(part.binned, part.threshold)))
    )


def about_contacts(loud: Neighbours) -> tuple[str, ...]:
    """That loud returns have no neighbours, as contacts have none; one sentence.

    Examples
    --------
    >>> about_contacts(Neighbours(50, 45.0, 40))
    ()
    """
    if loud.returns < FEWEST or loud.found >= LONE * loud.expected:
        return ()
    return (
        f"Of {loud.returns} loud returns {loud.found} have a neighbour, {loud.expected:.3g} expected: they look like "
        "contacts, one an echo, and speak against targets as bins; expected all bins, or a scenario with [contacts].",
    )


def _of_pair(part: PairReturns, remark: str) -> str:
    return f"{part.pair.name}: {remark[0].lower()}{remark[1:]}" if part.pair.name else remark


def about_bins(every: tuple[int, int, int], recognised: bool) -> tuple[str, ...]:
    """That bins are not all read; one sentence.

    Examples
    --------
    >>> about_bins((1, 1, 1), True)
    ()
    """
    names = "delay", "bearing", "Doppler"
    fine = [f"{number} in {name}" for name, number in zip(names, every, strict=True) if number > 1]
    if not fine or not recognised:
        return ()
    return (
        "Returns come in neighbouring bins together: the bins are finer than the resolution, and one of every "
        f"{' and '.join(fine)} is read (background.every).",
    )
