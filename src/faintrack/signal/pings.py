"""Returns in the bins of an active sonar, ping by ping.

Files tell delays, bearings and Doppler shifts; likelihoods read numbers of bins (`faintrack.sensors.active.Ping`).
Every return goes to the bin that it is nearest to. What has no bin is refused, and so are two returns in one, since a
bin has one power.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from faintrack.data.returns import Returns
from faintrack.errors import InputError
from faintrack.sensors.active import ActiveSonar, Ping
from faintrack.sensors.bistatic import Bistatic

ENTRIES = 16
"""Capacities are whole multiples of it."""


def capacity_of(returns: int) -> int:
    """Entries that hold some returns: in steps of an eighth, so that files of one sonar mostly share a compiled step.

    Examples
    --------
    >>> [capacity_of(count) for count in (0, 16, 17, 250, 300, 4651)]
    [16, 16, 32, 256, 320, 5120]
    """
    step = max(ENTRIES, 2 ** (max(returns, 1).bit_length() - 4))
    return step * max(1, -(-returns // step))


@dataclass(frozen=True)
class Binned:
    """Returns and their bins.

    Attributes
    ----------
    returns : as measured.
    sonar : whose bins they are.
    order : numbers of the returns, ping by ping and in each by delay, beam, Doppler.
    bins : of the returns in this order; shape (return, 3).
    pair : source and receiver in every ping, where they move.
    """

    returns: Returns
    sonar: ActiveSonar
    order: Int[np.ndarray, " return"]
    bins: Int[np.ndarray, "return 3"]
    pair: Bistatic | None = None

    @property
    def capacity(self) -> int:
        """Entries that hold the largest ping, `capacity_of` its returns."""
        return capacity_of(int(self.returns.counts.max()))

    def pings(self, numbers: Int[np.ndarray, " ping"]) -> Ping:
        """Stack of the pings with these numbers; their times are those of the file."""
        counts = self.returns.counts
        ends = np.cumsum(counts)
        there = np.arange(self.capacity) < counts[numbers, None]
        entry = ((ends - counts)[numbers, None] + np.arange(self.capacity))[there]
        bins, power = np.zeros((*there.shape, 3)), np.zeros(there.shape)
        bins[there], power[there] = self.bins[entry], self.returns.power[self.order[entry]]
        return Ping(
            jnp.asarray(self.returns.times[numbers], float),
            jnp.asarray(bins, jnp.int32),
            jnp.asarray(power, float),
            jnp.asarray(there),
            jax.tree.map(lambda leaf: leaf[numbers], self.pair),
        )


def in_bins(returns: Returns, sonar: ActiveSonar, threshold: float, pair: Bistatic | None = None) -> Binned:
    """Returns in the bins of a sonar.

    Parameters
    ----------
    returns : as measured.
    sonar : their bins.
    threshold : that every return exceeds, over the mean power of the noise; linear.
    pair : source and receiver in every ping, where they move.

    Raises
    ------
    InputError : a delay or Doppler shift beyond the bins, a power below the threshold, two returns of a ping in one
        bin, Doppler where the sonar measures none, or none where it does.
    """
    if (returns.doppler is None) != (sonar.doppler is None):
        told = "no column doppler_hz" if returns.doppler is None else "a column doppler_hz"
        raise InputError(
            f"{returns.origin}: there is {told}; expected it where the sonar measures Doppler, only there."
        )

    def refuse(wrong: np.ndarray, name: str, values: np.ndarray, expected: str) -> None:
        if wrong.any():
            first = int(np.argmax(wrong))
            raise InputError(
                f"{returns.origin}, row {returns.rows[first]}: {name} is {values[first]:.10g}; expected {expected}."
            )

    axes = [("delay_s", sonar.delay, returns.delay, "s")]
    if sonar.doppler is not None:
        assert returns.doppler is not None
        axes.append(("doppler_hz", sonar.doppler, returns.doppler, "Hz"))
    found = []
    for name, axis, values, unit in axes:
        number = np.floor((values - axis.first) / axis.step + 0.5)
        low, high = axis.edges[[0, -1]]
        refuse(
            (number < 0) | (number >= axis.count), name, values, f"{low:.10g} to {high:.10g} {unit}, the sonar's bins"
        )
        found.append(number)
    found.insert(1, np.floor(returns.bearing / sonar.beam_step + 0.5) % sonar.beams)
    if sonar.doppler is None:
        found.append(np.zeros(len(returns.delay)))
    snr_db, threshold_db = 10 * np.log10(returns.power), 10 * np.log10(threshold)
    # Conversion to decibel and back may take the last digit of a return just at the threshold.
    refuse(snr_db < threshold_db - 1e-6, "snr_db", snr_db, f"at least the threshold, {threshold_db:g} dB")
    bins = np.stack(found, axis=-1).astype(np.int64)
    flat = np.ravel_multi_index(tuple(bins.T), sonar.shape)
    order = np.lexsort((flat, returns.ping))
    same = (np.diff(flat[order]) == 0) & (np.diff(returns.ping[order]) == 0)
    if same.any():
        where = int(np.argmax(same))
        first, second = sorted(returns.rows[order[where : where + 2]])
        raise InputError(
            f"{returns.origin}, row {second}: the return falls in the same bin as that of row {first}; "
            "expected one a bin."
        )
    return Binned(returns, sonar, order, bins[order], pair)


def from_pings(pings: Ping, sonar: ActiveSonar, origin: str = "returns in memory") -> Returns:
    """Returns of a stack of pings, each in the middle of its bin; the inverse of `in_bins`.

    Examples
    --------
    >>> import math
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.sensors.active import Pulse, ping
    >>> sonar = ActiveSonar(Pulse(2350.0, 1.0, 400.0), Axis(4.0, 0.5, 40), 72, math.radians(5), None)
    >>> heard = ping(sonar, 60.0, np.array([[10, 18, 0]]), np.array([20.0]), capacity=4)
    >>> returns = from_pings(jax.tree.map(lambda leaf: leaf[None], heard), sonar)
    >>> returns.delay.tolist(), np.degrees(returns.bearing).round(3).tolist()
    ([9.0], [90.0])
    """
    there, bins = np.asarray(pings.there), np.asarray(pings.bins)
    ping, entry = np.nonzero(there)
    delay, beam, doppler = bins[ping, entry].T

    def placed(platform: str) -> Float[np.ndarray, "ping 4"] | None:
        if pings.pair is None:
            return None
        state = getattr(pings.pair, platform)
        return np.stack([np.asarray(part, float) for part in (state.x, state.y, state.vx, state.vy)], axis=-1)

    return Returns(
        np.asarray(pings.time, float),
        ping,
        sonar.delay.values[delay],
        beam * sonar.beam_step,
        np.asarray(pings.power, float)[ping, entry],
        None if sonar.doppler is None else sonar.doppler.values[doppler],
        placed("source"),
        placed("receiver"),
        np.arange(len(ping)),
        origin,
    )
