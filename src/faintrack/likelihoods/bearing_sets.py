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

That is the full form with :math:`P_D = 1` over :math:`n / M_c`: that there are more bearings than usual is itself a
sign of a target. A scan without bearings rules the target out in the published form.
"""

import dataclasses
import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.likelihoods.bearing_proposal import Candidates, along_bearings, where_likely
from faintrack.numerics.trigonometry import arctan2
from faintrack.sensors.bearing_draws import draw_bearing_set
from faintrack.sensors.bearing_sets import BearingSensor, BearingSet
from faintrack.targets.births import RangeBirth
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Birth

APART = 4.0
"""Standard deviations from which on two bearings are those of two targets."""


class BearingSetLikelihood(eqx.Module):
    """Log ratio of a set of bearings.

    Attributes
    ----------
    sensor : what it reports.
    published : takes the form of liu2013, eq. 12-13, in place of the full one; may vary without a new compilation.

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
    published: bool | Bool[Array, ""] = False

    @eqx.filter_jit
    def log_ratio(self, scan: BearingSet, states: Any) -> Float[Array, "..."]:
        """Natural log of p(bearings | target at state) / p(bearings | no target); 0 outside the sector.

        Parameters
        ----------
        scan : one scan.
        states : positions in the plane.
        """
        missed, each, within = self._terms(scan, states)
        log_sum = jnp.logaddexp(missed, jax.nn.logsumexp(each, axis=0))
        crowding = jnp.log(jnp.maximum(scan.there.sum(), 1) / self.sensor.false_per_scan)
        log_sum = log_sum - jnp.where(self.published, crowding, 0)
        return jnp.where(within, log_sum, 0).astype(scan.bearing.dtype)

    @eqx.filter_jit
    def association(self, scan: BearingSet, states: Any) -> Float[Array, "..."]:
        r"""Probability of every entry to be the target's bearing, if there is a target at the state.

        Parameters
        ----------
        scan : one scan.
        states : positions in the plane.

        Returns
        -------
        Shape (entry, ...), the states' after the entries'; what is left to 1 is the probability that the target was
        missed.

        Notes
        -----
        The share of the entry in the module's sum, :math:`P_D\, p(z_i | x) / (M_c p_c) / \ell(z | x)`.

        Examples
        --------
        >>> import math
        >>> import numpy as np
        >>> from faintrack.sensors.bearing_sets import bearing_set
        >>> from faintrack.targets.states import PlanarState
        >>> here, east = (PlanarState(*(jnp.array(v) for v in (x, 0.0, 0.0, 0.0))) for x in (0.0, 500.0))
        >>> sensor = BearingSensor(math.radians(1), 0.9, 5.0)
        >>> scan = bearing_set(sensor, 0.0, np.array([0.0, 2.0]), here, capacity=3)
        >>> [round(float(each), 3) for each in BearingSetLikelihood(sensor).association(scan, east)]
        [0.996, 0.0, 0.0]
        """
        missed, each, within = self._terms(scan, states)
        log_sum = jnp.logaddexp(missed, jax.nn.logsumexp(each, axis=0))
        share = jnp.where(log_sum > -jnp.inf, jnp.exp(each - log_sum), 0)
        return jnp.where(within, share, 0).astype(scan.bearing.dtype)

    def part(self, scan: BearingSet, states: Any, log_weights: Float[Array, " point"]) -> Float[Array, " entry"]:
        """What the bearings of a target add to the density of the false ones, as a multiple of that."""
        _, each, within = self._terms(dataclasses.replace(scan, crowding=None), states)
        return jnp.exp(jax.nn.logsumexp(jnp.where(within, each + log_weights, -jnp.inf), axis=1))

    def beside(
        self, scan: BearingSet, parts: Float[Array, "target entry"], existence: Float[Array, " target"]
    ) -> BearingSet:
        r"""Scan with other targets as part of its background: their bearings add to the density of the false ones.

        Notes
        -----
        .. math:: M_c p_c \leftarrow M_c p_c + \sum_t q_t P_D \sum_j w_{tj} \, p(z_i | x_{tj})

        (Musicki and La Scala, *Multi-target tracking in clutter without measurement assignment*, 2008).
        """
        before = jnp.ones_like(scan.bearing) if scan.crowding is None else scan.crowding
        return dataclasses.replace(scan, crowding=before + existence @ parts)

    def alike(self, scan: BearingSet, states: Any, centres: Any) -> Bool[Array, "centre *points"]:
        """Whether bearings are less apart than `APART` standard deviations of one."""
        toward = [arctan2(each.y - scan.observer.y, each.x - scan.observer.x) for each in (states, centres)]
        off = toward[0] - toward[1].reshape(-1, *(1,) * toward[0].ndim)
        off = off - 2 * jnp.pi * jnp.round(off / (2 * jnp.pi))
        return jnp.abs(off) <= APART * self.sensor.error

    def candidates(self, scan: BearingSet, birth: Birth) -> Candidates | None:
        """Function of (key, count) to new targets along the bearings of the scan; None of births that have no range."""
        return functools.partial(along_bearings, self, scan, birth) if isinstance(birth, RangeBirth) else None

    def propose(
        self, scan: BearingSet, birth: Birth, key: PRNGKeyArray, count: int
    ) -> tuple[PlanarState, Float[Array, " count"]]:
        """New targets as `candidates`, or where the ratio of states of the birth density is large."""
        candidates = self.candidates(scan, birth)
        return where_likely(self, scan, birth, key, count) if candidates is None else candidates(key, count)

    def simulate(
        self, scan: BearingSet, states: PlanarState, present: Bool[Array, ""] | bool, key: PRNGKeyArray
    ) -> BearingSet:
        """Bearings drawn from the full form, published or not; those that find no entry are left out.

        Parameters
        ----------
        scan : time, observer and number of entries.
        states : of a target; scalars.
        present : whether it is there.
        key : random key.
        """
        entries = len(scan.bearing)
        return draw_bearing_set(key, self.sensor, entries, scan.time, scan.observer, states, present)[0]

    def _terms(self, scan: BearingSet, states: Any) -> tuple[Array, Array, Array]:
        """Logs of the terms of the full ratio: of a target that was missed, of each entry; whether in the sector."""
        sensor = self.sensor
        expected = arctan2(states.y - scan.observer.y, states.x - scan.observer.x)
        entry = (len(scan.bearing), *(1,) * expected.ndim)
        off = scan.bearing.reshape(entry) - expected
        off = off - 2 * jnp.pi * jnp.round(off / (2 * jnp.pi))
        log_density = -0.5 * (off / sensor.error) ** 2 - jnp.log(sensor.error * jnp.sqrt(2 * jnp.pi))
        detected = jnp.asarray(jnp.where(self.published, 1, sensor.detection_probability), scan.bearing.dtype)
        each = jnp.log(detected) + log_density - jnp.log(sensor.false_per_radian)
        if scan.crowding is not None:
            each = each - jnp.log(scan.crowding).reshape(entry)
        each = jnp.where(scan.there.reshape(entry), each, -jnp.inf)
        return jnp.log1p(-detected), each, sensor.after_start(expected) <= sensor.width
