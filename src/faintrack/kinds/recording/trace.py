r"""Trace velocities: what results tell of an elevation beside it.

A wave at elevation :math:`\varepsilon` crosses a level array at :math:`v = c / \cos\varepsilon`. Of a belief with mean
:math:`m` and deviation :math:`s` of the elevation, to second order,

.. math:: \mathrm{E}\, v = v + \tfrac{1}{2} v'' s^2, \qquad
    \operatorname{var} v = v'^2 s^2 + \tfrac{1}{2} v''^2 s^4, \qquad
    \operatorname{cov}(v, x) = v' \operatorname{cov}(\varepsilon, x),

.. math:: v' = v \tan m, \qquad v'' = v (1 + 2 \tan^2 m) .
"""

import dataclasses
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from faintrack.results.schema import Component

COMPONENTS = (Component("elevation", "degree", float(np.degrees(1))), Component("trace_velocity", "m/s"))
"""Of a state, beside its bearing and SNR."""


@dataclass(frozen=True)
class TracedState:
    """Means of a `faintrack.targets.states.WaveState`, and of the trace velocity."""

    bearing: Any
    bearing_rate: Any
    snr_db: Any
    elevation: Any
    trace_velocity: Any


def with_trace_velocity(estimates: Any, sound_speed: float) -> Any:
    """Estimates of waves with their trace velocity as one component more (the module's equations).

    Parameters
    ----------
    estimates : of a tracker of `faintrack.targets.states.WaveState`, stacked.
    sound_speed : m/s.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from faintrack.targets.states import WaveState
    >>> from faintrack.trackers.single import Estimate
    >>> none, mean = jnp.zeros(1), WaveState(*(jnp.zeros(1) for _ in range(3)), jnp.radians(jnp.array([60.0])))
    >>> say = Estimate(none, none, jnp.zeros(1, int), none, mean, 1e-4 * jnp.eye(4)[None], none)
    >>> found = with_trace_velocity(say, 340.0)
    >>> found.mean.trace_velocity.round(1).tolist(), np.sqrt(found.covariance[:, 4, 4]).round(1).tolist()
    ([680.2], [11.8])
    """
    mean, covariance = estimates.mean, np.asarray(estimates.covariance, float)
    names = [field.name for field in dataclasses.fields(mean)]
    place = names.index("elevation")
    tangent = np.tan(np.asarray(mean.elevation, float))
    speed = sound_speed * np.sqrt(1 + tangent**2)
    first, second = speed * tangent, speed * (1 + 2 * tangent**2)
    variance = covariance[..., place, place]
    beside = first[..., None] * covariance[..., place, :]
    corner = first**2 * variance + second**2 * variance**2 / 2
    rows = np.concatenate([covariance, beside[..., None, :]], axis=-2)
    column = np.concatenate([beside, corner[..., None]], axis=-1)
    whole = np.concatenate([rows, column[..., None]], axis=-1)
    values = {name: getattr(mean, name) for name in names}
    state = TracedState(**values, trace_velocity=speed + second * variance / 2)
    return SimpleNamespace(**vars(estimates) | {"mean": state, "covariance": whole})
