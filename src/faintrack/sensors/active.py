r"""Active sonar: a pulse, and the bins of delay, bearing and Doppler in which its echoes are measured.

A target's echo of mean power s (over the noise) raises the mean of the bins around it to

.. math:: \mu_k = 1 + s\, h_k, \qquad
    h_k = b(\phi - \phi_k)\, |\chi(\tau - \tau_k, \nu - \nu_k)|^2

(aughenbaugh2010, eq. 8 and 12), with the beam response (eq. 9) and the ambiguity function of a pulse of length T and
bandwidth B (eq. 10-11)

.. math::
    b(\phi) = \left( \frac{\sin(\phi / \Delta\phi)}{\phi / \Delta\phi} \right)^2, \qquad
    \chi(\tau, \nu) = \left(1 - \frac{|\tau|}{T}\right) \frac{\sin u}{u}, \quad
    u = a \left(\nu - \frac{B \tau}{T}\right) T \left(1 - \frac{|\tau|}{T}\right) .

The argument's factor a is :math:`\pi` for the matched filter of an ideal pulse and 1 as published; B = 0 is a pulse of
constant frequency (CW), B > 0 a sweep (FM). Sweeps are measured without Doppler: what the velocity does to their delay,
:math:`\nu T / B`, is left out, as published.

A state whose nearest bin is not one of the sonar's, in the blanked time after the pulse, beyond the last delay or
outside the Doppler band, is not heard at all.
"""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from faintrack.beliefs.axis import Axis
from faintrack.errors import InputError
from faintrack.numerics.trigonometry import sine_cosine
from faintrack.sensors.bistatic import Bistatic

Real = Float[Array, "..."]


class Pulse(eqx.Module):
    """What is transmitted.

    Attributes
    ----------
    frequency : in its middle; Hz.
    duration : s.
    bandwidth : of a linear sweep; 0 for a pulse of constant frequency; Hz.
    factor : a of the module's equation.

    Raises
    ------
    InputError : a frequency or duration that is not above 0, or a bandwidth below 0.
    """

    frequency: float = eqx.field(static=True)
    duration: float = eqx.field(static=True)
    bandwidth: float = eqx.field(static=True, default=0.0)
    factor: float = eqx.field(static=True, default=math.pi)

    def __check_init__(self) -> None:
        if not (self.frequency > 0 and self.duration > 0 and self.bandwidth >= 0 and self.factor > 0):
            raise InputError(
                f"pulse of {self.frequency:g} Hz, {self.duration:g} s and bandwidth {self.bandwidth:g} Hz: expected "
                "frequency and duration above 0, bandwidth at least 0."
            )

    def ambiguity(self, delay: Real, doppler: Real | float) -> Real:
        """Ambiguity function at offsets in s and Hz (the module's equation); 0 beyond the length of the pulse."""
        inside = jnp.maximum(1 - jnp.abs(delay) / self.duration, 0)
        slant = doppler - self.bandwidth * delay / self.duration
        return inside * cardinal_sine(self.factor * slant * self.duration * inside)


def cardinal_sine(x: Real) -> Real:
    """sin(x) / x, without pi."""
    small = jnp.abs(x) < 1e-3
    return jnp.where(small, 1, sine_cosine(x)[0] / jnp.where(small, 1, x))


class ActiveSonar(eqx.Module):
    """Bins in which a pulse's echoes are measured.

    Attributes
    ----------
    pulse : what is transmitted.
    delay : of the bins; s. What is blanked after the pulse lies before the first, what is not listened to after the
        last.
    beams : number of beams, evenly around the receiver; the first points to +x, the others follow anticlockwise.
    beam_width : of the beam response: its first zeros lie pi times this from the middle of the beam; radians.
    doppler : of the bins; Hz; None where Doppler is not measured.
    pair : fixed source and receiver; None where every ping brings its own.
    reach : how many bins from its place, in delay, bearing and Doppler, an echo is heard; beyond, h is 0. Without
        Doppler the last is 0.

    Raises
    ------
    InputError : fewer than 3 beams, a beam width that is not above 0, a reach below 0, or one that is half around or
        more.

    Examples
    --------
    >>> sonar = ActiveSonar(Pulse(2350.0, 1.0, 400.0), Axis(4.3, 0.001, 29000), 72, math.radians(5), None)
    >>> sonar.shape
    (29000, 72, 1)
    """

    pulse: Pulse
    delay: Axis = eqx.field(static=True)
    beams: int = eqx.field(static=True)
    beam_width: float = eqx.field(static=True)
    doppler: Axis | None = eqx.field(static=True)
    pair: Bistatic | None = None
    reach: tuple[int, int, int] = eqx.field(static=True, default=(10, 6, 6))

    def __post_init__(self) -> None:
        if self.doppler is None:
            self.reach = (*self.reach[:2], 0)

    def __check_init__(self) -> None:
        if self.beams < 3 or not self.beam_width > 0:
            raise InputError(
                f"active sonar: {self.beams} beams of width {self.beam_width:g} rad; expected at least 3, above 0."
            )
        if min(self.reach) < 0 or 2 * self.reach[1] >= self.beams:
            raise InputError(
                f"active sonar: reach is {self.reach}; expected at least 0, and less than half of the {self.beams} "
                "beams."
            )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of bins in delay, bearing and Doppler."""
        return self.delay.count, self.beams, 1 if self.doppler is None else self.doppler.count

    @property
    def size(self) -> int:
        """Number of bins."""
        return math.prod(self.shape)

    @property
    def beam_step(self) -> float:
        """From one beam to the next; radians."""
        return 2 * math.pi / self.beams

    def geometry(self, ping: "Ping") -> Bistatic:
        """Source and receiver of a ping: its own, or those of the sonar."""
        pair = self.pair if ping.pair is None else ping.pair
        if pair is None:
            raise InputError("active sonar: neither the sonar nor the ping says where source and receiver are.")
        return pair

    def place(self, pair: Bistatic, states: Any) -> tuple[Real, Real, Real]:
        """Bin numbers, with their fractions, that the echoes of states fall on; bearings from 0 to `beams`."""
        delay, bearing = pair.echo(states)
        beam = bearing / self.beam_step
        beam = beam - self.beams * jnp.floor(beam / self.beams)
        number = jnp.asarray(self.delay.place(delay))
        if self.doppler is None:
            return number, beam, jnp.zeros_like(number)
        return number, beam, jnp.asarray(self.doppler.place(pair.doppler(states, self.pulse.frequency)))

    def heard(self, delay: Real, doppler: Real) -> Bool[Array, "..."]:
        """Whether the nearest bin of an echo at bin numbers with fractions is one of the sonar's."""
        within = (delay >= -0.5) & (delay < self.shape[0] - 0.5)
        return within & (doppler >= -0.5) & (doppler < self.shape[2] - 0.5)

    def response(self, delay: Real, beam: Real, doppler: Real) -> Real:
        """h of the module's equation for an echo at offsets in bins, the beams counted the shorter way round."""
        step = 0.0 if self.doppler is None else self.doppler.step
        heard = cardinal_sine(beam * (self.beam_step / self.beam_width)) ** 2
        heard = heard * self.pulse.ambiguity(delay * self.delay.step, doppler * step) ** 2
        within = (jnp.abs(delay) <= self.reach[0]) & (jnp.abs(beam) <= self.reach[1])
        return jnp.where(within & (jnp.abs(doppler) <= self.reach[2]), heard, 0)

    def tabled(self, delay: np.ndarray, beam: np.ndarray, doppler: np.ndarray) -> Float[np.ndarray, "..."]:
        """`response` at fixed offsets as plain numbers, also while something is being traced."""
        with jax.ensure_compile_time_eval():
            offsets = jnp.asarray(delay), jnp.asarray(beam), jnp.asarray(doppler)
            return np.asarray(eqx.filter_jit(ActiveSonar.response)(self, *offsets), float)


class Ping(eqx.Module):
    """Returns of one ping, or of a stack of them: the bins whose power exceeded the threshold.

    Attributes
    ----------
    time : of transmission; seconds.
    bins : numbers of delay, beam and Doppler bin of every return, in ascending order of the delay.
    power : of the returns, over the mean power of the noise; linear.
    there : whether an entry is a return; those that are not come last.
    pair : source and receiver, where they move.
    rate : probability that the background alone exceeds the threshold in the bin of each return, where it is not that
        of noise with mean 1. Powers are then those that an excess as rare has in such noise
        (`faintrack.signal.returns_background`).
    """

    time: Float[Array, "*ping"]
    bins: Int[Array, "*ping return 3"]
    power: Float[Array, "*ping return"]
    there: Bool[Array, "*ping return"]
    pair: Bistatic | None = None
    rate: Float[Array, "*ping return"] | None = None


def ping(
    sonar: ActiveSonar,
    time: float,
    bins: np.ndarray,
    power: np.ndarray,
    capacity: int,
    pair: Bistatic | None = None,
) -> Ping:
    """Ping with returns in any order.

    Parameters
    ----------
    sonar : that heard them.
    time : of transmission; seconds.
    bins : shape (return, 3); whole numbers.
    power : of the returns, over the mean power of the noise; linear.
    capacity : entries; at least as many as there are returns.
    pair : source and receiver, where they move.

    Raises
    ------
    InputError : more returns than capacity, a bin that the sonar does not have, two returns in one bin, a power that
        is not a number above 0.
    """
    bins, power = np.asarray(bins, int).reshape(-1, 3), np.asarray(power, float)
    if len(power) != len(bins):
        raise InputError(f"ping at {time:g} s: {len(bins)} bins and {len(power)} powers; expected one power a bin.")
    if len(bins) > capacity:
        raise InputError(f"ping at {time:g} s: {len(bins)} returns; expected at most the capacity, {capacity}.")
    wrong = np.flatnonzero(((bins < 0) | (bins >= sonar.shape)).any(axis=1))
    if wrong.size:
        raise InputError(
            f"ping at {time:g} s, return {wrong[0]}: bin {tuple(map(int, bins[wrong[0]]))}; "
            f"expected delay, beam and Doppler below {sonar.shape}."
        )
    bad = np.flatnonzero(~((power > 0) & np.isfinite(power)))
    if bad.size:
        raise InputError(f"ping at {time:g} s, return {bad[0]}: power is {power[bad[0]]:g}; expected above 0.")
    flat = np.ravel_multi_index(tuple(bins.T), sonar.shape)
    order = np.argsort(flat)
    if (np.diff(flat[order]) == 0).any():
        twice = bins[order[np.flatnonzero(np.diff(flat[order]) == 0)[0]]]
        raise InputError(f"ping at {time:g} s: two returns in the bin {tuple(map(int, twice))}; expected one a bin.")
    missing = capacity - len(bins)
    return Ping(
        jnp.asarray(time, float),
        jnp.asarray(np.pad(bins[order], ((0, missing), (0, 0))), jnp.int32),
        jnp.asarray(np.pad(power[order], (0, missing)), float),
        jnp.arange(capacity) < len(bins),
        pair,
    )
