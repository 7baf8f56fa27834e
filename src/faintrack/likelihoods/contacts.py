r"""Contacts: what a sensor reports after its own detection, as a likelihood ratio.

A contact is a position, a line of bearing, or just the word that something was detected. Whether there is a target is
told by what the sensor says when there is none: a false contact lies anywhere in the region that it covers, a false
bearing has any direction, a false alarm has its probability. With that the contact enters by the same rule as a scan,
and contacts of different sensors combine by adding their log ratios (`Together`; stone2002, section 2.4). Each can
also draw its measurement.
"""

import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.likelihoods.protocols import CellMeans, Likelihood, log_ratios
from faintrack.numerics.precision import full_precision
from faintrack.numerics.trigonometry import arctan2
from faintrack.targets.states import PlanarState

Position = tuple[float, float]
Probability = Callable[[Array], Array]
"""Function of the range from a sensor, metres, to the probability of detection."""


class Contact(eqx.Module):
    """What one sensor reports at one time.

    Attributes
    ----------
    time : seconds.
    value : components in their order; a bearing in radians anticlockwise from +x; or whether there was a detection.
    """

    time: Float[Array, ""]
    value: Float[Array, "..."] | Bool[Array, ""]


class GaussianContact(eqx.Module):
    r"""Log ratio of an estimate of some components of the state with Gaussian error.

    Attributes
    ----------
    names : of the components that a contact tells, in the order of its value.
    covariance : of the error.
    low, high : corners of the region in which a false contact lies, anywhere alike.

    Notes
    -----
    .. math:: \log \ell(y | x) = -\tfrac12 (y - M x)^T \Sigma^{-1} (y - M x) - \tfrac12 \log |2 \pi \Sigma| + \log V

    with y the contact, M the choice of components, and V the volume of the region. Source: stone2002, eq. 8.
    Check: the mean of exp(log ratio) of false contacts is 1, for a state far from the region's edges.

    Examples
    --------
    >>> contact = GaussianContact(("x", "y"), jnp.eye(2), (-10.0, -10.0), (10.0, 10.0))
    >>> state = PlanarState(jnp.array([0.0, 5.0]), jnp.zeros(2), jnp.zeros(2), jnp.zeros(2))
    >>> ratio = contact.log_ratio(Contact(jnp.array(0.0), jnp.zeros(2)), state)
    >>> [round(float(each), 2) for each in ratio]
    [4.15, -8.35]
    """

    names: tuple[str, ...] = eqx.field(static=True)
    covariance: Float[Array, "component component"]
    low: tuple[float, ...] = eqx.field(static=True)
    high: tuple[float, ...] = eqx.field(static=True)

    def __check_init__(self) -> None:
        if not len(self.names) == len(self.low) == len(self.high) == self.covariance.shape[0]:
            raise InputError(
                f"contact of {', '.join(self.names)}: covariance and region have {self.covariance.shape[0]}, "
                f"{len(self.low)} and {len(self.high)} components; expected {len(self.names)}."
            )
        if not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise InputError(f"contact of {', '.join(self.names)}: low {self.low} is not below high {self.high}.")

    @eqx.filter_jit
    @full_precision
    def log_ratio(self, contact: Contact, states: Any) -> Float[Array, "..."]:
        """Natural log of p(contact | target at state) / p(contact | no target); the class's equation."""
        chosen = jnp.stack(jnp.broadcast_arrays(*(getattr(states, name) for name in self.names)))
        error = contact.value.reshape(-1, *(1,) * (chosen.ndim - 1)) - chosen
        form = jnp.einsum("i...,ij,j...->...", error, jnp.linalg.inv(self.covariance), error)
        log_volume = sum(math.log(high - low) for low, high in zip(self.low, self.high, strict=True))
        return log_volume - form / 2 - jnp.linalg.slogdet(2 * jnp.pi * self.covariance)[1] / 2

    def simulate(self, key: PRNGKeyArray, time: Float[Array, ""], state: Any, present: bool | Array = True) -> Contact:
        """Contact with a target at a state of scalars, or a false one."""
        for_error, for_place = jax.random.split(key)
        middle = jnp.stack([getattr(state, name) for name in self.names])
        true = jax.random.multivariate_normal(for_error, middle, self.covariance)
        low, high = (jnp.asarray(corner, middle.dtype) for corner in (self.low, self.high))
        false = jax.random.uniform(for_place, middle.shape, middle.dtype, low, high)
        return Contact(time, jnp.where(present, true, false))


class BearingContact(eqx.Module):
    r"""Log ratio of a line of bearing with Gaussian error.

    Attributes
    ----------
    position : x, y of the sensor; metres.
    error : standard deviation of a bearing; radians.

    Notes
    -----
    .. math:: \log \ell(\beta | x) = \log \sum_k \frac{2 \pi}{\sqrt{2 \pi} \sigma}
        \exp\left(-\frac{(\beta - \beta(x) + 2 \pi k)^2}{2 \sigma^2}\right)

    with the bearing of the state in radians anticlockwise from +x, and false bearings alike in all directions. Source:
    stone2002, section 2.4.2. Check: the mean of exp(log ratio) of false bearings is 1.

    Examples
    --------
    >>> state = PlanarState(*(jnp.array(each) for each in (60.0, 10.0, 0.0, 0.0)))
    >>> bearing = BearingContact((70.0, 0.0), math.radians(15.0))
    >>> round(float(bearing.log_ratio(Contact(jnp.array(0.0), jnp.array(math.radians(135.0))), state)), 3)
    2.259
    """

    position: Position = eqx.field(static=True)
    error: Float[Array, ""] | float

    def __check_init__(self) -> None:
        if isinstance(self.error, float) and not self.error > 0:
            raise InputError(f"bearing contact: error is {self.error:g}; expected above 0.")

    @eqx.filter_jit
    def log_ratio(self, contact: Contact, states: PlanarState) -> Float[Array, "..."]:
        """Natural log of p(contact | target at state) / p(contact | no target); the class's equation."""
        off = contact.value - self._bearing(states)
        off = jnp.arctan2(jnp.sin(off), jnp.cos(off))
        # One more turn either way is enough up to an error of half a turn.
        turns = 2 * jnp.pi * jnp.arange(-1, 2).reshape(-1, *(1,) * off.ndim)
        scaled = (off + turns.astype(off.dtype)) / self.error
        return jax.nn.logsumexp(-scaled * scaled / 2, axis=0) + jnp.log((2 * jnp.pi) ** 0.5 / self.error)

    def simulate(
        self, key: PRNGKeyArray, time: Float[Array, ""], state: PlanarState, present: bool | Array = True
    ) -> Contact:
        """Bearing of a target at a state of scalars, or a false one; within half a turn."""
        for_error, for_direction = jax.random.split(key)
        true = self._bearing(state)
        true = true + self.error * jax.random.normal(for_error, (), true.dtype)
        false = jax.random.uniform(for_direction, (), true.dtype, -jnp.pi, jnp.pi)
        drawn = jnp.where(present, true, false)
        return Contact(time, jnp.arctan2(jnp.sin(drawn), jnp.cos(drawn)))

    def _bearing(self, states: PlanarState) -> Array:
        return arctan2(states.y - self.position[1], states.x - self.position[0])


class RangeDetection(eqx.Module):
    r"""Log ratio of a detection, or of none, by a sensor that detects better at some ranges than at others.

    Attributes
    ----------
    position : x, y of the sensor; metres.
    detection_probability : function of range; below 1, and above 0 where a detection must not exclude a target.
    false_alarm_probability : of a detection without a target; between 0 and 1.

    Notes
    -----
    .. math:: \ell(1 | x) = P_d(r(x)) / P_f, \qquad \ell(0 | x) = (1 - P_d(r(x))) / (1 - P_f)

    Source: stone2002, section 2.4.2. Check: the mean of the ratio without a target is P_d + (1 - P_d) = 1.

    Examples
    --------
    >>> detection = RangeDetection((70.0, 0.0), convergence_zones(30.0, 10.0), 0.01)
    >>> near = PlanarState(*(jnp.array(each) for each in (70.0, 0.0, 0.0, 0.0)))
    >>> [round(float(detection.log_ratio(Contact(jnp.array(0.0), jnp.array(each)), near)), 2) for each in (True, False)]
    [4.5, -2.29]
    """

    position: Position = eqx.field(static=True)
    detection_probability: Probability = eqx.field(static=True)
    false_alarm_probability: Float[Array, ""] | float

    @eqx.filter_jit
    def log_ratio(self, contact: Contact, states: PlanarState) -> Float[Array, "..."]:
        """Natural log of p(contact | target at state) / p(contact | no target); the class's equation."""
        probability, false = self._probability(states), self.false_alarm_probability
        detected = jnp.log(probability) - jnp.log(false)
        return jnp.where(contact.value, detected, jnp.log1p(-probability) - jnp.log1p(-false))

    def simulate(
        self, key: PRNGKeyArray, time: Float[Array, ""], state: PlanarState, present: bool | Array = True
    ) -> Contact:
        """Whether there is a detection, with a target at a state of scalars or without."""
        probability = jnp.where(present, self._probability(state), self.false_alarm_probability)
        return Contact(time, jax.random.bernoulli(key, probability))

    def _probability(self, states: PlanarState) -> Array:
        return self.detection_probability(jnp.hypot(states.x - self.position[0], states.y - self.position[1]))


def convergence_zones(
    spacing: float, width: float, zones: int = 3, best: float = 0.9, worst: float = 0.02
) -> Probability:
    r"""Detection probability of an underwater sensor: near by, and in rings where sound comes back to the surface.

    Parameters
    ----------
    spacing : range of the first zone, and from each to the next; metres.
    width : w of a zone, and of the direct path around the sensor; metres.
    zones : number of them, beside the direct path.
    best, worst : detection probability in the middle of a zone, and far from all; between 0 and 1.

    Notes
    -----
    .. math:: P_d(r) = P_w + (P_b - P_w) \max_{k = 0}^{K} e^{-(r - k R)^2 / (2 w^2)}

    The shape of stone2002, figure 1, which does not print its numbers.

    Raises
    ------
    InputError : a probability outside (0, 1), or no width or spacing.

    Examples
    --------
    >>> probability = convergence_zones(30.0, 3.0)(jnp.array([0.0, 15.0, 30.0, 60.0, 120.0]))
    >>> [round(float(each), 2) for each in probability]
    [0.9, 0.02, 0.9, 0.9, 0.02]
    """
    if not (0 < worst <= best < 1 and spacing > 0 and width > 0):
        raise InputError(
            f"convergence zones: best {best:g}, worst {worst:g}, spacing {spacing:g}, width {width:g}; "
            "expected 0 < worst <= best < 1, and lengths above 0."
        )

    def probability(distance: Array) -> Array:
        nearest = jnp.clip(jnp.round(distance / spacing), 0, zones) * spacing
        return worst + (best - worst) * jnp.exp(-(((distance - nearest) / width) ** 2) / 2)

    return probability


class Together(eqx.Module):
    """Log ratio of independent sensors: the sum of theirs (stone2002, section 2.4.3).

    Attributes
    ----------
    likelihoods : one a sensor, of any kind.
    """

    likelihoods: tuple[Likelihood | CellMeans, ...]

    @eqx.filter_jit
    def log_ratio(self, scans: tuple[Any, ...], states: Any) -> Float[Array, "..."]:
        """Natural log of p(scans | target at state) / p(scans | no target), one scan a likelihood in their order."""
        every = [log_ratios(each, scan, states) for each, scan in zip(self.likelihoods, scans, strict=True)]
        return sum(every[1:], start=every[0])
