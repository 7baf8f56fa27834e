r"""Energies of the beams of several arrays: how many targets are in each.

Integrated over frequency, the energy of a beam is a sum of many independent terms and all but Gaussian
(kreucher2011, II-B). Without a target it has mean :math:`m_0` and standard deviation :math:`s_0`, with one
:math:`m_1` and :math:`s_1`. Targets are independent, so the energies of n in one beam add:

.. math::
    p_n = N\left(m_0 + n (m_1 - m_0), \; s_0^2 + n (s_1^2 - s_0^2)\right)

Beams and arrays are independent given the targets, and only the beams that a target falls in differ from noise. One
target has the ratio (kreucher2011, eq. 14-15)

.. math:: \ell(z|x) = \prod_j \frac{p_1(z_j[b_j(x)])}{p_0(z_j[b_j(x)])}

and several have (eq. 28)

.. math:: \frac{p(z|X)}{p(z|0)} = \prod_j \prod_{i \in B_j(X)} \frac{p_{n_i}(z_j[i])}{p_0(z_j[i])}

with :math:`n_i` of them in beam i. All of it is read from one table a scan, the log ratio of every beam for every
number of targets.

A **region** that is searched knows of energy from outside: a target elsewhere, heard by some arrays, is no target here.
Absence then is a composite hypothesis (eq. 18, for two arrays), and the ratio compares presence with the best of it:

.. math::
    \ell_R(z|x) = \frac{\prod_j p_{1j}}{\max_{S \ne \text{all}} \prod_{j \in S} p_{1j} \prod_{j \notin S} p_{0j}},
    \qquad
    \log \ell_R = \sum_j \min(\lambda_j, 0) + \max(\min_j \lambda_j, 0)

with :math:`\lambda_j = \log p_{1j} / p_{0j}`: the evidence of absence in full, or the weakest of presence. The second
form holds for any number of arrays, S being any set of arrays but all that hear the place. Its mean without a
target is below 1: it is careful by construction. What one of several arrays hears alone counts against a target only;
an array by itself has nobody to ask, and its ratio is that of eq. 15.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.numerics.precision import full_precision
from faintrack.sensors.stations import EnergyScan, Fans

Level = Float[Array, " array"] | Float[np.ndarray, " array"] | float


class BeamEnergies(eqx.Module):
    """What beams report without a target, with one, and with several.

    Attributes
    ----------
    fans : beams of every array.
    absent_mean, absent_std : of the energy of a beam without a target; unit of the energies.
    present_mean, present_std : with one; the mean above, the standard deviation not below that without.

    Raises
    ------
    InputError : standard deviations not above 0, or a target that is not louder than none.

    Examples
    --------
    >>> import math
    >>> from faintrack.sensors.stations import Stations
    >>> from faintrack.targets.states import PlanarState
    >>> fans = Fans((0.0,), (math.radians(1),), (181,), (True,))
    >>> likelihood = BeamEnergies(fans, 0.0, 1.0, 2.0, 1.0)
    >>> stations = Stations(jnp.zeros(1), jnp.zeros(1), jnp.full(1, math.pi / 2))
    >>> energy = jnp.zeros((1, 181)).at[0, 90].set(2.0)
    >>> scan = EnergyScan(jnp.array(0.0), energy, jnp.ones((1, 181), bool), stations)
    >>> north = PlanarState(*(jnp.array(value) for value in (0.0, 900.0, 0.0, 0.0)))
    >>> float(likelihood.log_ratio(scan, north))
    2.0
    """

    fans: Fans
    absent_mean: Level = 0.0
    absent_std: Level = 1.0
    present_mean: Level = 2.0
    present_std: Level = 1.0

    def __check_init__(self) -> None:
        values = [np.asarray(getattr(self, name), float) for name in LEVELS if _known(getattr(self, name))]
        if len(values) < len(LEVELS):
            return
        absent_mean, absent_std, present_mean, present_std = values
        if not (np.all(absent_std > 0) and np.all(present_std >= absent_std)):
            raise InputError(
                f"beam energies: standard deviations {absent_std} without and {present_std} with a target; expected "
                "above 0, and the second not below the first."
            )
        if not np.all(present_mean > absent_mean):
            raise InputError(
                f"beam energies: means {absent_mean} without and {present_mean} with a target; expected the second "
                "above the first."
            )

    def table(self, scan: EnergyScan, most: int = 1) -> Float[Array, "array beam number"]:
        """Natural log of p_n / p_0 of every beam for n from 0 to `most` targets; 0 where it is not usable.

        One beam more than the fans have stands last: it says nothing, and is where number -1 points.
        """
        number = jnp.arange(most + 1)
        mean, std, one_mean, one_std = (
            jnp.reshape(jnp.asarray(getattr(self, name), scan.energy.dtype), (-1, 1, 1)) for name in LEVELS
        )
        variance = std**2 + number * (one_std**2 - std**2)
        off = scan.energy[:, :, None] - mean
        excess = off - number * (one_mean - mean)
        log_density = -0.5 * (excess**2 / variance + jnp.log(variance))
        ratio = jnp.where(scan.usable[:, :, None], log_density - log_density[:, :, :1], 0)
        return jnp.pad(ratio, ((0, 0), (0, 1), (0, 0)))

    @eqx.filter_jit
    def log_ratio(self, scan: EnergyScan, states: Any) -> Float[Array, "..."]:
        """Natural log of p(energies | target at state) / p(energies | no target); eq. 15.

        Parameters
        ----------
        scan : one scan.
        states : positions in the plane, or states with a bearing.
        """
        return jnp.sum(in_beams(self.table(scan)[:, :, 1], self.fans.beams(scan.stations, states)), axis=0)

    def energies(self, targets: Int[Array, "*scan array beam"], key: PRNGKeyArray) -> Float[Array, "*scan array beam"]:
        """Draw the energy of every beam, given the number of targets in it."""
        mean, std, one_mean, one_std = (jnp.reshape(jnp.asarray(getattr(self, name)), (-1, 1)) for name in LEVELS)
        noise = jax.random.normal(key, (targets.size,)).reshape(targets.shape)
        return mean + targets * (one_mean - mean) + jnp.sqrt(std**2 + targets * (one_std**2 - std**2)) * noise

    def simulate(self, scan: EnergyScan, states: Any, present: Bool[Array, ""] | bool, key: PRNGKeyArray) -> EnergyScan:
        """Scan drawn from the module's densities; beams that were not measured stay so.

        Parameters
        ----------
        scan : where the arrays are, and which beams were measured.
        states : of a target; scalars.
        present : whether it is there.
        key : random key.
        """
        number = jnp.arange(scan.energy.shape[-1])
        beams = self.fans.beams(scan.stations, states)
        energy = self.energies(((beams[:, None] == number) & present).astype(jnp.int32), key)
        return dataclasses.replace(scan, energy=energy.astype(scan.energy.dtype))


LEVELS = ("absent_mean", "absent_std", "present_mean", "present_std")


def in_beams(values: Float[Array, "array beam"], beams: Int[Array, "array *points"]) -> Float[Array, "array *points"]:
    """Value of every array at the beam of each point; that of the last beam where the number is -1."""
    array = jnp.arange(len(values)).reshape(-1, *(1,) * (beams.ndim - 1))
    return values[array, beams]


def region_log_ratio(
    ratios: Float[Array, "array *points"], heard: Bool[Array, "array *points"]
) -> Float[Array, "*points"]:
    r"""Log ratio for a region that energy from outside reaches (the module's last equation; kreucher2011, eq. 18).

    Parameters
    ----------
    ratios : :math:`\lambda_j` of every array, in the beam of each point.
    heard : which arrays hear the point at all; what the others say is not read.

    Examples
    --------
    >>> both = jnp.ones((2, 3), bool)
    >>> region_log_ratio(jnp.array([[3.0, 3.0, -3.0], [1.0, -1.0, -1.0]]), both).tolist()
    [1.0, -1.0, -4.0]
    """
    ratios = jnp.where(heard, ratios, 0)
    weakest = jnp.min(jnp.where(heard, ratios, jnp.inf), axis=0)
    together = (jnp.sum(heard, axis=0) >= min(2, len(ratios))) & (weakest > 0)
    return jnp.sum(jnp.minimum(ratios, 0), axis=0) + jnp.where(together, weakest, 0)


@full_precision
def occupied_log_ratios(
    table: Float[Array, "array beam number"],
    beams: Int[Array, "array target particle"],
    there: Bool[Array, "target particle"],
    joint: Bool[Array, "target target"],
) -> tuple[Float[Array, "target particle"], Float[Array, "array target particle"]]:
    r"""Log ratios of particles that stand for several targets at once, eq. 28, and what each of them adds.

    Particle p of all targets of a group is one joint state :math:`X_p`.

    Parameters
    ----------
    table : `BeamEnergies.table`; of as many targets as there are.
    beams : of every target in every particle; -1 where an array does not hear it.
    there : whether a target is part of a joint state.
    joint : whether two targets are of one group; every target is of its own.

    Returns
    -------
    log p(z | X without the target) / p(z | 0) of the group of each target, and what every array adds with it: their
    sum is log p(z | X with it) / p(z | X without it).
    """
    same = (beams[:, :, None] == beams[:, None, :]) & joint[None, :, :, None] & there[None, None, :, :]
    others = jnp.sum(same & ~jnp.eye(joint.shape[0], dtype=bool)[None, :, :, None], axis=2)
    array = jnp.arange(table.shape[0])[:, None, None]
    before, after = table[array, beams, others], table[array, beams, others + 1]
    # Targets in one beam share its ratio evenly, so that the sum over a group counts every beam once.
    each = jnp.sum(jnp.where(there, after / (others + 1), 0), axis=0)
    whole = jnp.einsum("tu,up->tp", joint.astype(each.dtype), each)
    own = after - before
    return whole - jnp.where(there, jnp.sum(own, axis=0), 0), own


def set_log_ratio(
    table: Float[Array, "array beam number"],
    beams: Int[Array, "array target particle"],
    there: Bool[Array, "target particle"],
    members: Bool[Array, " target"],
    joint: Bool[Array, "target target"],
) -> Float[Array, " particle"]:
    r"""Log ratio of particles for a set of targets, in a region that energy from outside reaches.

    Beside targets that are there, the energy of a beam speaks for the n members in it together, and each has an even
    share of the ratio. What array j says for a group is the sum over its members, :math:`\lambda_j`, and the set has
    the sum of :math:`\log \ell_R` over its groups (the module's last equation). So two sets that explain the same
    beams, two targets or the two places where their beams cross otherwise, have the same ratio; a set of one target has
    that of `region_log_ratio`.

    Parameters
    ----------
    table : `BeamEnergies.table`; of as many targets as there are.
    beams : of every target in every particle; -1 where an array does not hear it.
    there : whether a target is part of a joint state for certain.
    members : targets of the set; none of those that are there.
    joint : whether two targets are of one group; every target is of its own.

    Returns
    -------
    log of p(z | X, targets that are there and members) / p(z | X, targets that are there), with the best explanation
    without the members below the line.
    """
    same = (beams[:, :, None] == beams[:, None, :]) & joint[None, :, :, None]
    others = jnp.sum(same & there, axis=2)
    count = jnp.sum(same & members[:, None], axis=2)
    array = jnp.arange(table.shape[0])[:, None, None]
    ratio = table[array, beams, others + count] - table[array, beams, others]
    shares = jnp.where(members[:, None], ratio / jnp.maximum(count, 1), 0)
    within = (joint & members)[None, :, :, None]
    together = jnp.sum(jnp.where(within, shares[:, None], 0), axis=2)
    heard = jnp.any(within & (beams >= 0)[:, None], axis=2)
    size = jnp.maximum(jnp.sum(within, axis=2), 1)[0]
    return jnp.sum(jnp.where(members[:, None], region_log_ratio(together, heard) / size, 0), axis=0)


def _known(value: Any) -> bool:
    """Whether a number can be looked at, not only traced."""
    return isinstance(value, (int, float, np.ndarray, np.generic))
