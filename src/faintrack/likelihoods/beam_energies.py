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

A **region** that is searched knows of energy from outside: a source elsewhere, which some arrays hear, is no target
here. The paper takes the best explanation of two arrays by such sources for absence (eq. 18); taken over all sets of
arrays only the weakest array would count, and one more would find a target later. As Bayes has it, a beam holds k
sources from elsewhere with the probability :math:`(1 - e) e^k`, as loud as targets and independent of all others, and n
targets in it have the density

.. math:: \bar p_n = \sum_{k \ge 0} (1 - e) \, e^k \, p_{n + k}

in place of :math:`p_n`, in every ratio above. For one target and at most one source that is
:math:`((1 - e) p_1 + e p_2) / ((1 - e) p_0 + e p_1)`. Every array that hears the place adds its logarithm:

.. math:: \lambda_j = \log \frac{\bar p_1(z_j[b_j(x)])}{\bar p_0(z_j[b_j(x)])}, \qquad \log \ell_R = \sum_j \lambda_j

What follows from it, and can be repeated:

- The mean of a beam's ratio over :math:`\bar p_0`, the energies without a target, is :math:`\int \bar p_1 = 1`; over
  noise alone, without a source from elsewhere, it is below :math:`1 / (1 - e)`, as :math:`\bar p_0 \ge (1 - e) p_0`.
- At a target the mean of every :math:`\lambda_j` is the divergence of :math:`\bar p_1` from :math:`\bar p_0`, which is
  not negative: an array more is evidence more.
- What a beam says for a target is bounded, since :math:`e \, \bar p_1 = \bar p_0 - (1 - e) p_0`:
  :math:`\lambda_j \le \log 1 / e`, however loud it is. What it says against one is not.

With e = 0 all of it is the paper's product. That is for an array by itself: whatever it hears is a target of its own.

The model draws sources anew in every scan. One that **stays** in its beam explains all that a single array hears of a
target as well as the target does, and the odds of the two remain what they were. So where one of several arrays hears a
place alone, the ratio compares with the better of nothing and such a source, as eq. 18 does, and only counts against a
target: :math:`\log \ell_R = \min(\lambda, 0)`.
"""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.numerics.precision import full_precision
from faintrack.sensors.stations import EnergyScan, Fans, Stations

ELSEWHERE = 0.05
"""Probability of a source from elsewhere in a beam of several arrays, where nothing else is known of it."""

SOURCES = 4
"""Sources from elsewhere in a beam, beside targets, up to which densities are summed."""

MOST_ELSEWHERE = 0.2
"""Probability of such a source at most: of more than `SOURCES` it is then below a thousandth."""

Level = Float[Array, " array"] | Float[np.ndarray, " array"] | float


class BeamEnergies(eqx.Module):
    """What beams report without a target, with one, and with several.

    Attributes
    ----------
    fans : beams of every array.
    absent_mean, absent_std : of the energy of a beam without a target; unit of the energies.
    present_mean, present_std : with one; the mean above, the standard deviation not below that without.
    elsewhere : probability that a beam holds a source that is no target of the region, and of each further one; 0 to
        `MOST_ELSEWHERE`. Sums over them end at `SOURCES`.

    Raises
    ------
    InputError : standard deviations not above 0, a target that is not louder than none, a probability beyond those.

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
    elsewhere: float = eqx.field(static=True, default=0.0)

    def __check_init__(self) -> None:
        if not 0 <= self.elsewhere <= MOST_ELSEWHERE:
            raise InputError(
                f"beam energies: a beam holds a source from elsewhere with probability {self.elsewhere:g}; expected 0 "
                f"to {MOST_ELSEWHERE:g}."
            )
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
        """Natural log of the ratio of every beam for n targets to none, n from 0 to `most`; 0 where it is not usable.

        Both densities are those with sources from elsewhere. One beam more than the fans have stands last: it says
        nothing, and is where number -1 points.
        """
        sources = SOURCES if self.elsewhere else 0
        number = jnp.arange(most + sources + 1)
        mean, std, one_mean, one_std = (
            jnp.reshape(jnp.asarray(getattr(self, name), scan.energy.dtype), (-1, 1, 1)) for name in LEVELS
        )
        variance = std**2 + number * (one_std**2 - std**2)
        off = scan.energy[:, :, None] - mean
        excess = off - number * (one_mean - mean)
        log_density = -0.5 * (excess**2 / variance + jnp.log(variance))
        log_density = log_density - log_density[:, :, :1]
        if self.elsewhere:
            # Times e^n it is the sum of e^i p_i over i from n on, which ends at one i for all n: so the bound holds.
            step = number * math.log(self.elsewhere)
            log_density = (jax.lax.cumlogsumexp(log_density + step, axis=2, reverse=True) - step)[:, :, : most + 1]
        ratio = jnp.where(scan.usable[:, :, None], log_density - log_density[:, :, :1], 0)
        return jnp.pad(ratio, ((0, 0), (0, 1), (0, 0)))

    @eqx.filter_jit
    def log_ratio(self, scan: EnergyScan, states: Any) -> Float[Array, "..."]:
        """Natural log of p(energies | target at state) / p(energies | no target); eq. 15, with the module's densities.

        Parameters
        ----------
        scan : one scan.
        states : positions in the plane, or states with a bearing.
        """
        return jnp.sum(in_beams(self.table(scan)[:, :, 1], self.fans.beams(scan.stations, states)), axis=0)

    def mean_log_ratio(self) -> Float[Array, " array"]:
        """Mean natural log of the ratio of a beam that holds a target and no other source: what a scan adds, by array.

        Examples
        --------
        >>> fans = Fans((0.0,), (0.1,), (10,), (True,))
        >>> [round(float(BeamEnergies(fans, present_mean=3.0, elsewhere=e).mean_log_ratio()[0]), 2) for e in (0, 0.03)]
        [4.5, 2.55]
        """
        steps = jnp.linspace(-8.0, 8.0, 1601)
        mean, std = (jnp.reshape(jnp.asarray(getattr(self, name)), (-1, 1)) for name in ("present_mean", "present_std"))
        energy = jnp.broadcast_to(mean + std * steps, (self.fans.arrays, len(steps)))
        none = jnp.zeros(self.fans.arrays)
        scan = EnergyScan(jnp.array(0.0), energy, jnp.ones(energy.shape, bool), Stations(none, none, none))
        density = jax.nn.softmax(-0.5 * steps**2)
        return jnp.sum(density * self.table(scan)[:, :-1, 1], axis=1)

    def energies(self, targets: Int[Array, "*scan array beam"], key: PRNGKeyArray) -> Float[Array, "*scan array beam"]:
        """Draw the energy of every beam, given the number of targets in it; sources from elsewhere come to it."""
        for_noise, for_sources = jax.random.split(key)
        if self.elsewhere:
            draw = jax.random.uniform(for_sources, (targets.size,), minval=jnp.finfo(jnp.float32).tiny)
            sources = jnp.floor(jnp.log(draw) / math.log(self.elsewhere)).astype(targets.dtype)
            targets = targets + sources.reshape(targets.shape)
        mean, std, one_mean, one_std = (jnp.reshape(jnp.asarray(getattr(self, name)), (-1, 1)) for name in LEVELS)
        noise = jax.random.normal(for_noise, (targets.size,)).reshape(targets.shape)
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
    r"""Log ratio for a region: summed over the arrays, and not above 0 where only one of several hears the place.

    Parameters
    ----------
    ratios : :math:`\lambda_j` of every array, in the beam of each point.
    heard : which arrays hear the point at all; what the others say is not read.

    Examples
    --------
    >>> heard = jnp.array([[True, True, True], [True, True, False]])
    >>> region_log_ratio(jnp.array([[3.0, 3.0, 3.0], [1.0, -4.0, -4.0]]), heard).tolist()
    [4.0, -1.0, 0.0]
    """
    total = jnp.sum(jnp.where(heard, ratios, 0), axis=0)
    return jnp.where(jnp.sum(heard, axis=0) >= min(2, len(ratios)), total, jnp.minimum(total, 0))


def beside(
    table: Float[Array, "array beam number"], shares: Float[Array, "target array beam"]
) -> Float[Array, "array beam"]:
    r"""Natural log of the ratio of every beam for one target more, beside targets that may be in it.

    With :math:`P(n)` the probability that n of them are in a beam, independent of each other,

    .. math:: \log \frac{\sum_n P(n) \, \bar p_{n+1}}{\sum_n P(n) \, \bar p_n}

    Parameters
    ----------
    table : `BeamEnergies.table`; of one target more than there are.
    shares : probability that each is in each beam.

    Examples
    --------
    >>> table = jnp.array([[[0.0, 2.0, 0.0]]])
    >>> [round(float(beside(table, jnp.full((1, 1, 1), share))[0, 0]), 2) for share in (0.0, 1.0)]
    [2.0, -2.0]
    """
    most = table.shape[2] - 1

    def joined(number: Array, share: Array) -> tuple[Array, None]:
        one_more = jnp.pad(number[..., :-1], ((0, 0), (0, 0), (1, 0)))
        return number * (1 - share[..., None]) + one_more * share[..., None], None

    none = jnp.zeros((*table.shape[:2], most), table.dtype).at[..., 0].set(1)
    log_number = jnp.log(jax.lax.scan(joined, none, shares)[0])
    with_it = jax.nn.logsumexp(log_number + table[..., 1:], axis=2)
    return with_it - jax.nn.logsumexp(log_number + table[..., :-1], axis=2)


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

    Beside targets that are there, the energy of a beam speaks for the members in it together, and every beam counts
    once: each member has an even share of the ratio of its beams, and its shares are summed as by `region_log_ratio`.
    So two sets that explain the same beams, two targets or the two places where their beams cross otherwise, have the
    same ratio; a set of one target has that of `region_log_ratio`.

    Parameters
    ----------
    table : `BeamEnergies.table`; of as many targets as there are.
    beams : of every target in every particle; -1 where an array does not hear it.
    there : whether a target is part of a joint state for certain.
    members : targets of the set; none of those that are there.
    joint : whether two targets are of one group; every target is of its own.

    Returns
    -------
    log of p(z | X, targets that are there and members) / p(z | X, targets that are there).
    """
    same = (beams[:, :, None] == beams[:, None, :]) & joint[None, :, :, None]
    others = jnp.sum(same & there, axis=2)
    count = jnp.sum(same & members[:, None], axis=2)
    array = jnp.arange(table.shape[0])[:, None, None]
    ratio = table[array, beams, others + count] - table[array, beams, others]
    each = region_log_ratio(ratio / jnp.maximum(count, 1), beams >= 0)
    return jnp.sum(jnp.where(members[:, None], each, 0), axis=0)


def _known(value: Any) -> bool:
    """Whether a number can be looked at, not only traced."""
    return isinstance(value, (int, float, np.ndarray, np.generic))
