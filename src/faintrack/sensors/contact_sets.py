r"""Contacts of an active sonar: what a detector of echoes reports of a ping, the target's perhaps among them.

A contact is a delay or a range, a bearing and perhaps a Doppler shift, with independent Gaussian errors. A target is
reported at most once in a ping, with the probability :math:`P_D`. False contacts come evenly over all that the sonar
reports, from the first delay to the last, over a sector of bearings and a band of Doppler; their number is Poisson, and
given as the expected number in a ping, so that no density can be taken for one of another unit.

An error may carry a contact over the edge of what is reported. The probability that it does not,

.. math::
    A(x) = \prod_k \left[ \Phi\left(\frac{b_k - h_k(x)}{\sigma_k}\right)
    - \Phi\left(\frac{a_k - h_k(x)}{\sigma_k}\right) \right]

with :math:`h_k(x)` the value expected of a target at x and :math:`a_k, b_k` the ends, belongs to the detection: far
outside it is 0, and a target there is not reported at all.
"""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from faintrack.errors import InputError
from faintrack.sensors.bistatic import Bistatic

Scalar = Float[Array, ""] | float

BEARING = 1
"""Place of the bearing among the values of a contact."""


class ContactSensor(eqx.Module):
    """What a detector of echoes reports.

    Attributes
    ----------
    errors : standard deviations of the delay (s) or range (m), of the bearing (rad), and of the Doppler shift (Hz)
        where it is measured.
    detection_probability : that a target is reported in a ping, if its contact is not carried over an edge.
    false_per_ping : expected number of false contacts in a ping.
    ends : lowest and highest value of each that is reported; of the bearing, where the sector starts anticlockwise from
        +x, and where it ends, a turn later at most.
    ranged : whether distances are ranges from the receiver, in place of delays.
    frequency : of the pulse, Hz; read only where Doppler is measured.

    Raises
    ------
    InputError : an error or a number of false contacts that is not above 0, a probability outside 0 to 1, ends that are
        not in their order, a sector of more than a turn.

    Examples
    --------
    >>> from faintrack.sensors.bistatic import fixed
    >>> sonar = Bistatic(fixed(0.0, 0.0), fixed(0.0, 0.0))
    >>> sensor = ContactSensor((0.01, 0.02), 0.9, 5.0, ((0.5, 10.0), (-math.pi, math.pi)))
    >>> [round(float(value), 3) for value in sensor.expected(sonar, fixed(0.0, 3000.0))]
    [4.0, 1.571]
    """

    errors: tuple[Scalar, ...]
    detection_probability: Scalar
    false_per_ping: Scalar
    ends: tuple[tuple[float, float], ...] = eqx.field(static=True)
    ranged: bool = eqx.field(static=True, default=False)
    frequency: float = eqx.field(static=True, default=0.0)

    def __check_init__(self) -> None:
        names = ("distance", "bearing", "Doppler")
        if not (2 <= len(self.errors) == len(self.ends) <= 3):
            raise InputError(
                f"contact sensor: {len(self.errors)} errors and {len(self.ends)} ends; expected 2 or 3 of each."
            )
        for name, (low, high) in zip(names, self.ends, strict=False):
            if not low < high:
                raise InputError(f"contact sensor: {name} goes from {low:g} to {high:g}; expected the lower end first.")
        if self.width > 2 * math.pi + 1e-9:
            raise InputError(f"contact sensor: width of the sector is {self.width:g} rad; expected at most a turn.")
        values = {f"error of the {name}": error for name, error in zip(names, self.errors, strict=False)}
        values |= {"false_per_ping": self.false_per_ping, "detection_probability": self.detection_probability}
        for name, value in values.items():
            most = 1.0 if name == "detection_probability" else math.inf
            # What is traced has no value yet.
            if not isinstance(value, jax.core.Tracer) and not (0 < value <= most and value < math.inf):
                raise InputError(
                    f"contact sensor: {name} is {value:g}; expected above 0{', at most 1' if most == 1 else ''}."
                )

    @property
    def width(self) -> float:
        """Of the sector of bearings; radians."""
        return self.ends[BEARING][1] - self.ends[BEARING][0]

    @property
    def all_around(self) -> bool:
        """Whether the sector is a whole turn."""
        return self.width > 2 * math.pi - 1e-9

    @property
    def volume(self) -> float:
        """Of all that is reported: the product of the ends' distances, in the units of the values."""
        return math.prod(high - low for low, high in self.ends)

    def expected(self, pair: Bistatic, states: Any) -> tuple[Float[Array, "..."], ...]:
        """Values of the contact of a target, without errors; the bearing from -pi to pi."""
        distance, bearing = pair.echo(states)
        if self.ranged:
            distance = jnp.hypot(states.x - pair.receiver.x, states.y - pair.receiver.y)
        values = distance, bearing
        return values if len(self.errors) == 2 else (*values, pair.doppler(states, self.frequency))

    def inside(self, expected: tuple[Float[Array, "..."], ...]) -> Float[Array, "..."]:
        """Probability that no error carries a contact over an edge (the module's equation)."""
        inside: Any = 1.0
        for number, (value, error, (low, high)) in enumerate(zip(expected, self.errors, self.ends, strict=True)):
            if number == BEARING:
                if self.all_around:
                    continue
                # From the middle of the sector, half a turn either way.
                value = _turned(value - (low + high) / 2)
                low, high = (low - high) / 2, (high - low) / 2
            inside = inside * _between((low - value) / error, (high - value) / error)
        return jnp.asarray(inside, expected[0].dtype)

    def off(
        self, values: Float[Array, "entry component"], expected: tuple[Float[Array, "..."], ...]
    ) -> tuple[Float[Array, "entry ..."], ...]:
        """How far contacts are from what is expected, each component over its standard deviation."""
        entry = (len(values), *(1,) * expected[0].ndim)
        apart = []
        for number, (value, error) in enumerate(zip(expected, self.errors, strict=True)):
            difference = values[:, number].reshape(entry) - value
            apart.append((_turned(difference) if number == BEARING else difference) / error)
        return tuple(apart)

    def after_start(self, bearing: Float[Array, "..."]) -> Float[Array, "..."]:
        """How far bearings lie from the start of the sector, anticlockwise; 0 to a turn."""
        turns = (bearing - self.ends[BEARING][0]) / (2 * math.pi)
        return 2 * math.pi * (turns - jnp.floor(turns))


class ContactSet(eqx.Module):
    """Contacts of one ping, or of a stack of pings.

    Attributes
    ----------
    time : seconds.
    values : of every entry, in the order of `ContactSensor.errors`.
    there : whether an entry is a contact; those that are not come last.
    pair : source and receiver; components have the shape of `time`.
    crowding : density of false contacts and those of other targets at each entry, over that of the false ones; 1 where
        None.
    """

    time: Float[Array, "*scan"]
    values: Float[Array, "*scan entry component"]
    there: Bool[Array, "*scan entry"]
    pair: Bistatic
    crowding: Float[Array, "*scan entry"] | None = None


def _turned(angle: Float[Array, "..."]) -> Float[Array, "..."]:
    return angle - 2 * jnp.pi * jnp.round(angle / (2 * jnp.pi))


def _between(low: Float[Array, "..."], high: Float[Array, "..."]) -> Float[Array, "..."]:
    """Probability of a standard normal number between two others; in the tails by the side that is small."""
    above = low > 0
    return jax.scipy.special.ndtr(jnp.where(above, -low, high)) - jax.scipy.special.ndtr(jnp.where(above, -high, low))
