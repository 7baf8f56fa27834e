r"""Sets of contacts of an active sonar, at most one from the target: nobody knows which.

What `faintrack.likelihoods.bearing_sets` is for bearings this is for contacts of delay or range, bearing and Doppler
(`faintrack.sensors.contact_sets`). With n contacts :math:`z_i` in a ping, the expected number :math:`M_c` of false ones
over the volume V of all that is reported, detection probability :math:`P_D` and the probability :math:`A(x)` that no
error carries the target's contact over an edge, the sum over what the contacts may mean is

.. math:: \ell(z | x) = 1 - P_D A(x) + \frac{P_D V}{M_c} \sum_i \prod_k N(z_{ik}; h_k(x), \sigma_k^2) .

Its mean under false contacts alone is exactly 1, also for a target at an edge. Where all bins above a threshold are
kept, several of an echo, they are weighed as they are (`faintrack.likelihoods.guided`), which loses nothing to a
detector; where a detector has made one contact of each echo, that likelihood is wrong and this one right.
"""

import dataclasses
import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.likelihoods.bearing_proposal import Candidates, where_likely
from faintrack.likelihoods.contact_proposal import about_contacts
from faintrack.sensors.contact_draws import draw_contact_set
from faintrack.sensors.contact_sets import ContactSensor, ContactSet
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Birth, UniformBirth

APART = 4.0
"""Standard deviations from which on two contacts are those of two targets, in any component."""


class ContactSetLikelihood(eqx.Module):
    """Log ratio of a set of contacts.

    Attributes
    ----------
    sensor : what it reports.

    Examples
    --------
    >>> import math
    >>> from faintrack.sensors.bistatic import Bistatic, fixed
    >>> sensor = ContactSensor((10.0, 0.02), 0.9, 5.0, ((100.0, 9000.0), (-math.pi, math.pi)), ranged=True)
    >>> sonar = Bistatic(fixed(0.0, 0.0), fixed(0.0, 0.0))
    >>> contacts = ContactSet(jnp.array(0.0), jnp.array([[3000.0, 0.0], [500.0, 2.0]]), jnp.array([True, True]), sonar)
    >>> likelihood = ContactSetLikelihood(sensor)
    >>> [round(float(likelihood.log_ratio(contacts, fixed(*place))), 2) for place in ((3000.0, 0.0), (0.0, 3000.0))]
    [8.99, -2.3]
    """

    sensor: ContactSensor

    @eqx.filter_jit
    def log_ratio(self, scan: ContactSet, states: Any) -> Float[Array, "..."]:
        """Natural log of p(contacts | target at state) / p(contacts | no target); the module's equation.

        Parameters
        ----------
        scan : one ping.
        states : positions in the plane, and velocities where Doppler is measured.
        """
        missed, each = self._terms(scan, states)
        return jnp.logaddexp(missed, jax.nn.logsumexp(each, axis=0)).astype(scan.values.dtype)

    @eqx.filter_jit
    def association(self, scan: ContactSet, states: Any) -> Float[Array, "..."]:
        r"""Probability of every entry to be the target's contact, if there is a target at the state.

        Parameters
        ----------
        scan : one ping.
        states : as of `log_ratio`.

        Returns
        -------
        Shape (entry, ...), the states' after the entries'; what is left to 1 is the probability that the target was
        missed.

        Notes
        -----
        The share of the entry in the module's sum.
        """
        missed, each = self._terms(scan, states)
        log_sum = jnp.logaddexp(missed, jax.nn.logsumexp(each, axis=0))
        return jnp.where(log_sum > -jnp.inf, jnp.exp(each - log_sum), 0).astype(scan.values.dtype)

    def part(self, scan: ContactSet, states: Any, log_weights: Float[Array, " point"]) -> Float[Array, " entry"]:
        """What the contacts of a target add to the density of the false ones, as a multiple of that."""
        _, each = self._terms(dataclasses.replace(scan, crowding=None), states)
        return jnp.exp(jax.nn.logsumexp(each + log_weights, axis=1))

    def beside(
        self, scan: ContactSet, parts: Float[Array, "target entry"], existence: Float[Array, " target"]
    ) -> ContactSet:
        r"""Scan with other targets as part of its background: their contacts add to the density of the false ones.

        Notes
        -----
        .. math:: \frac{M_c}{V} \leftarrow \frac{M_c}{V} + \sum_t q_t P_D \sum_j w_{tj} \prod_k N(z_{ik}; h_k(x_{tj}),
            \sigma_k^2)

        (Musicki and La Scala, *Multi-target tracking in clutter without measurement assignment*, 2008).
        """
        before = jnp.ones_like(scan.values[..., 0]) if scan.crowding is None else scan.crowding
        return dataclasses.replace(scan, crowding=before + existence @ parts)

    def alike(self, scan: ContactSet, states: Any, centres: Any) -> Bool[Array, "centre *points"]:
        """Whether contacts are less apart than `APART` standard deviations in every component."""
        expected = self.sensor.expected(scan.pair, states)
        middles = jnp.stack(self.sensor.expected(scan.pair, centres), axis=-1)
        off = jnp.stack(jnp.broadcast_arrays(*self.sensor.off(middles, expected)))
        return jnp.all(jnp.abs(off) <= APART, axis=0)

    def candidates(self, scan: ContactSet, birth: Birth) -> Candidates | None:
        """Function of (key, count) to new targets about the contacts of the ping; None of births that fill no box."""
        return functools.partial(about_contacts, self, scan, birth) if isinstance(birth, UniformBirth) else None

    def propose(
        self, scan: ContactSet, birth: Birth, key: PRNGKeyArray, count: int
    ) -> tuple[PlanarState, Float[Array, " count"]]:
        """New targets as `candidates`, or where the ratio of states of the birth density is large."""
        candidates = self.candidates(scan, birth)
        return where_likely(self, scan, birth, key, count) if candidates is None else candidates(key, count)

    def simulate(
        self, scan: ContactSet, states: PlanarState, present: Bool[Array, ""] | bool, key: PRNGKeyArray
    ) -> ContactSet:
        """Contacts drawn from the model; those that find no entry are left out.

        Parameters
        ----------
        scan : time, source and receiver, and number of entries.
        states : of a target; scalars.
        present : whether it is there.
        key : random key.
        """
        return draw_contact_set(key, self.sensor, len(scan.values), scan.time, scan.pair, states, present)[0]

    def _terms(self, scan: ContactSet, states: Any) -> tuple[Array, Array]:
        """Logs of the terms of the ratio: of a target that was missed, and of each entry."""
        sensor = self.sensor
        expected = sensor.expected(scan.pair, states)
        each: Any = jnp.log(sensor.detection_probability) + jnp.log(sensor.volume) - jnp.log(sensor.false_per_ping)
        for off, error in zip(sensor.off(scan.values, expected), sensor.errors, strict=True):
            each = each - 0.5 * off**2 - jnp.log(error * jnp.sqrt(2 * jnp.pi))
        entry = (len(scan.values), *(1,) * (each.ndim - 1))
        if scan.crowding is not None:
            each = each - jnp.log(scan.crowding).reshape(entry)
        each = jnp.where(scan.there.reshape(entry), each, -jnp.inf)
        return jnp.log1p(-sensor.detection_probability * sensor.inside(expected)), each
