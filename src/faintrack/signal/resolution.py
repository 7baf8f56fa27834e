r"""Bins finer than a sonar resolves: told by their returns, and thinned to those that are independent.

Where bins are finer than the resolution, or beams overlap, noise that exceeds the threshold in one does so in its
neighbours too, and counted one by one it is several times the evidence that it is. Of independent bins one that lies
some bins from a return holds another as often as any bin; of linked ones more often. With :math:`n_l` the pairs of
returns that lie l bins apart along one axis in one ping and alike along the others, of N returns, such bins are linked
where

.. math:: \frac{n_l - \bar n}{N} > \text{`LINKED`} ,

with :math:`\bar n` the pairs that lie farther apart, up to `FAR` bins more, and so tell the level of the place. Echoes
of targets too lie beside each other, but in few places: no block of delay and bearing counts more than one pair and
twice the median of the blocks, and pairs must lie in a share `SPREAD` of those that hold returns, in `FEWEST` at least.

Every c-th bin is then one of a sonar with bins c times as far apart, and c the least number from which on none are
linked. What falls between is not read. An echo loses at most what it loses between two bins of any such sonar.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from faintrack.beliefs.axis import Axis
from faintrack.data.returns import Returns
from faintrack.sensors.active import ActiveSonar
from faintrack.signal.pings import Binned, in_bins

LINKED = 0.02
"""Share of the returns that have another at a distance, beyond chance, from which on such bins are linked."""

LONGEST = 16
"""Bins that are linked at most."""

FAR = 12
"""Distances beyond those of bins that may be linked, by which chance is known."""

BLOCKS = 8
"""Of delay and of bearing, in which pairs are counted."""

SPREAD = 1 / 3
"""Of the blocks with returns, in which there are pairs where bins are linked."""

FEWEST = 8
"""Blocks with pairs that tell anything."""


def linked_bins(binned: Binned) -> tuple[int, int, int]:
    """Bins of delay, bearing and Doppler from one to the next that is independent of it; 1 where each is.

    Of beams it is a divisor of their number; 1 where there is none.

    Examples
    --------
    >>> import math
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.data.returns import from_columns
    >>> from faintrack.sensors.active import Pulse
    >>> sonar = ActiveSonar(Pulse(2350.0, 1.0, 50.0), Axis(4.0, 0.005, 4000), 72, math.radians(5), None)
    >>> rng = np.random.default_rng(0)
    >>> pairs = rng.permutation(1990 * 72)[:400]
    >>> delay = 4.0 + 0.01 * np.repeat(pairs // 72, 2) + np.tile([0.0, 0.005], 400)
    >>> columns = {"time_s": np.zeros(800), "delay_s": delay, "bearing_deg": np.repeat(5.0 * (pairs % 72), 2)}
    >>> linked_bins(in_bins(from_columns(columns | {"snr_db": np.full(800, 12.0)}), sonar, 8.0))
    (2, 1, 1)
    """
    return (_linked(binned, 0), _linked(binned, 1), _linked(binned, 2))


def _linked(binned: Binned, axis: int) -> int:
    shape, ping = binned.sonar.shape, binned.returns.ping[binned.order]
    count, longest = shape[axis], min(LONGEST, shape[axis] // 4)
    if longest < 1 or not len(ping):
        return 1
    keys = np.ravel_multi_index((ping, *binned.bins.T), (binned.returns.length, *shape))

    def beside(lag: int) -> Bool[np.ndarray, " return"]:
        """Whether each return has another some bins on."""
        bins = binned.bins.copy()
        bins[:, axis] += lag
        inside = bins[:, axis] < count
        bins[:, axis] %= count
        other = np.ravel_multi_index((ping, *bins.T), (binned.returns.length, *shape))
        return (inside | (axis == 1)) & np.isin(other, keys)

    blocks = (binned.bins[:, :2] * BLOCKS // np.array(shape[:2])) @ [BLOCKS, 1]
    holding = len(np.unique(blocks))

    def pairs(lag: int) -> Int[np.ndarray, " block"]:
        return np.bincount(blocks[beside(lag)], minlength=BLOCKS**2)

    far = [pairs(lag) for lag in range(longest + 1, min(longest + FAR, count // 2) + 1)]
    linked = 0
    for lag in range(1, longest + 1):
        near = pairs(lag)
        most = 1 + 2 * np.median(near)
        more = np.minimum(near, most).sum() - sum(np.minimum(each, most).sum() for each in far) / len(far)
        if np.count_nonzero(near) >= max(SPREAD * holding, FEWEST) and more > LINKED * len(ping):
            linked = lag
    step = linked + 1
    # Evenly around: the last beam is a neighbour of the first.
    even = [number for number in range(step, count // 3 + 1) if count % number == 0]
    return step if axis != 1 else even[0] if even else 1


def thinned(binned: Binned, every: tuple[int, int, int], threshold: float) -> Binned:
    """Returns of every so many bins alone, in a sonar that has no others.

    Parameters
    ----------
    binned : in all bins.
    every : bins of delay, bearing and Doppler from one that is kept to the next.
    threshold : that every return exceeds, over the mean power of the noise; linear.
    """
    if every == (1, 1, 1):
        return binned
    sonar, returns = binned.sonar, binned.returns
    beams = sonar.beams // every[1]
    delay, bearing, doppler = wider(sonar.reach, every)
    kept = np.sort(binned.order[(binned.bins % np.array(every) == 0).all(axis=1)])
    coarse = ActiveSonar(
        sonar.pulse,
        _coarse(sonar.delay, every[0]),
        beams,
        sonar.beam_width,
        None if sonar.doppler is None else _coarse(sonar.doppler, every[2]),
        sonar.pair,
        (delay, min(bearing, (beams - 1) // 2), doppler),
    )
    fewer = _of(returns, kept)
    return in_bins(fewer, coarse, threshold, binned.pair)


def wider(bins: tuple[int, int, int], every: tuple[int, int, int]) -> tuple[int, int, int]:
    """As many bins in steps of some.

    Examples
    --------
    >>> wider((12, 6, 0), (3, 1, 1))
    (4, 6, 0)
    """
    delay, bearing, doppler = (-(-number // step) for number, step in zip(bins, every, strict=True))
    return delay, bearing, doppler


def _coarse(axis: Axis, every: int) -> Axis:
    return Axis(axis.first, axis.step * every, -(-axis.count // every))


def _of(returns: Returns, kept: Int[np.ndarray, " kept"]) -> Returns:
    """Some of the returns of all pings."""
    names = ("ping", "delay", "bearing", "power", "rows", *(() if returns.doppler is None else ("doppler",)))
    chosen: dict[str, Any] = {name: getattr(returns, name)[kept] for name in names}
    return replace(returns, **chosen)
