r"""Sets of bearings, at most one from the target: nobody knows which.

With n bearings :math:`z_i` in a scan, probability of detection :math:`P_D`, expected number of false bearings
:math:`M_c` and the density :math:`p_c = 1 / V` of each over the sector of width V, the target's bearing is any of the n
or none. Summed over these associations, and over the Poisson probability of as many false bearings as then are left,

.. math::
    p(z | x) = e^{-M_c} \left[ (1 - P_D) (M_c p_c)^n + P_D \sum_i p(z_i | x) (M_c p_c)^{n - 1} \right],
    \qquad p(z | \phi) = e^{-M_c} (M_c p_c)^n

as densities of a set without order, so that

.. math:: \ell(z | x) = 1 - P_D + P_D \sum_i \frac{p(z_i | x)}{M_c p_c} .

liu2013 (eq. 12-13) takes the target to be detected in every scan and leaves out the Poisson probability: given n, each
bearing is the target's with probability 1 / n, and

.. math:: \ell(z | x) = \frac{1}{n} \sum_i \frac{p(z_i | x)}{p_c} .

The two differ by the factor :math:`n / M_c`: that there are more bearings than usual is itself a sign of a target. A
scan without bearings rules the target out in the published form.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.sensors.bearing_sets import BearingSensor, BearingSet


class BearingSetLikelihood(eqx.Module):
    """Log ratio of a set of bearings.

    Attributes
    ----------
    sensor : what it reports.
    published : takes the form of liu2013, eq. 12-13, in place of the full one.

    Examples
    --------
    >>> import math
    >>> import numpy as np
    >>> from faintrack.sensors.bearing_sets import bearing_set
    >>> from faintrack.targets.states import PlanarState
    >>> at = lambda x, y: PlanarState(jnp.array(x), jnp.array(y), jnp.zeros(()), jnp.zeros(()))
    >>> sensor = BearingSensor(math.radians(1), 0.9, 5.0)
    >>> scan = bearing_set(sensor, 0.0, np.array([0.0, 2.0]), at(0.0, 0.0), capacity=6)
    >>> likelihood = BearingSetLikelihood(sensor)
    >>> [round(float(likelihood.log_ratio(scan, at(*place))), 2) for place in ((500.0, 0.0), (0.0, 500.0))]
    [3.26, -2.3]
    """

    sensor: BearingSensor
    published: bool = eqx.field(static=True, default=False)

    def log_ratio(self, scan: BearingSet, states: Any) -> Float[Array, "..."]:
        """Natural log of p(bearings | target at state) / p(bearings | no target); 0 outside the sector.

        Parameters
        ----------
        scan : one scan.
        states : positions in the plane.
        """
        sensor, dtype = self.sensor, scan.bearing.dtype
        expected = jnp.arctan2(states.y - scan.observer.y, states.x - scan.observer.x)
        entry = (len(scan.bearing), *(1,) * expected.ndim)
        off = scan.bearing.reshape(entry) - expected
        off = off - 2 * jnp.pi * jnp.round(off / (2 * jnp.pi))
        log_density = -0.5 * (off / sensor.error) ** 2 - jnp.log(sensor.error * jnp.sqrt(2 * jnp.pi))
        log_density = jnp.where(scan.there.reshape(entry), log_density, -jnp.inf)
        log_sum = jax.nn.logsumexp(log_density, axis=0) - jnp.log(sensor.false_per_radian)
        if self.published:
            log_sum = log_sum + jnp.log(sensor.false_per_scan / jnp.maximum(scan.there.sum(), 1))
        else:
            detected = jnp.asarray(sensor.detection_probability, dtype)
            log_sum = jnp.logaddexp(jnp.log1p(-detected), jnp.log(detected) + log_sum)
        return jnp.where(sensor.after_start(expected) <= sensor.width, log_sum, 0).astype(dtype)
