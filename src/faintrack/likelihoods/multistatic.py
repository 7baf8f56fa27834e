r"""The mean of a likelihood ratio over the cells of a grid, of what several pairs of source and receiver hear.

Pairs of a source and a receiver measure independently, so that the ratio of a state is the product of theirs. A cell
needs the mean of that product, and the product of the means is another number: where two loud returns lie in a cell and
their ellipses do not cross in it, no state explains both. With :math:`\ell_p = d_p + e_p`, where :math:`d_p` is what
pair p says of a state far from its returns and :math:`e_p` the excess near them,

.. math::
    \prod_p \ell_p = \prod_p d_p + \sum_p e_p \prod_{q \ne p} d_q
    + \sum_{p < q} e_p e_q \prod_{r < q,\, r \ne p} d_r \prod_{r > q} \ell_r ,

every set of pairs with an excess being counted by its first two. Each sum has points of its own.

- :math:`\prod d_p` changes at the ends of what pairs hear; it is taken at `WITHIN` times `WITHIN` places of a cell.
- The sum over p has the mesh points near the returns of p, as in `faintrack.likelihoods.guided`.
- The sum over two pairs has points where the swaths of their returns cross (`faintrack.likelihoods.crossings`).

Where nothing is near, or only one pair has a return, the last sum is 0. An excess is taken as 0 where it is negative:
where a return speaks against a target, which one above the threshold hardly ever does. Three pairs and more that
measure Doppler are read coarsely: the third in the middle of what the strips of the first two have in common, which may
be several of its own bins long where their directions are nearly the same.

Check: dense random states of a cell, whose ratios are multiplied state by state.
"""

import dataclasses
import itertools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError
from faintrack.likelihoods.crossings import log_crossed
from faintrack.likelihoods.excess import Excess, excess_of
from faintrack.likelihoods.guided import AT_ONCE, Guided
from faintrack.numerics.precision import full_precision
from faintrack.sensors.bistatic import Bistatic
from faintrack.sensors.multistatic import Pings
from faintrack.targets.states import PlanarState

WITHIN = 6
"""Places along each side of a cell at which is looked whether a pair hears them."""

LEAST = 1e-3
"""Of a mean at least, where sums of points do not add up."""

Real = Float[Array, "..."]


class Multistatic(eqx.Module):
    """Log of the mean ratio of every cell of a grid, of what several pairs heard.

    Attributes
    ----------
    guided : of each pair, all on one grid.
    order : of the pairs, those with the finest delays first.

    Raises
    ------
    InputError : no pair, or grids that differ.

    Examples
    --------
    >>> import math
    >>> from faintrack.beliefs.axis import Axis, between
    >>> from faintrack.likelihoods.exceedances import ExceedanceLikelihood
    >>> from faintrack.sensors.active import ActiveSonar, Pulse, ping
    >>> from faintrack.sensors.bistatic import fixed
    >>> place = between(-30e3, 30e3, 24)
    >>> grid, pulse = Grid(PlanarState, (("x", place), ("y", place))), Pulse(2350.0, 1.0, 50.0)
    >>> state, every, heard = fixed(9000.0, 12_000.0), [], []
    >>> for receiver in (fixed(0.0, 5000.0), fixed(6000.0, 0.0)):
    ...     pair = Bistatic(fixed(0.0, 0.0), receiver)
    ...     sonar = ActiveSonar(pulse, Axis(4.3, 0.02, 1500), 72, math.radians(5), None, pair)
    ...     every.append(Guided(ExceedanceLikelihood(sonar, snr=9.0, threshold=10.0), grid))
    ...     bins = np.round([float(part) for part in sonar.place(pair, state)]).astype(int)
    ...     heard.append(ping(sonar, 0.0, bins[None], np.array([20.0]), capacity=8))
    >>> means = Multistatic(every).log_mean_ratio(Pings(jnp.array(0.0), tuple(heard), jnp.array([True, True])))
    >>> best = np.unravel_index(int(means.argmax()), means.shape)
    >>> [float(place.values[number]) for number in best], round(float(means.max()), 1)
    ([8750.0, 11250.0], 16.9)
    """

    guided: tuple[Guided, ...]
    order: tuple[int, ...] = eqx.field(static=True)
    audible: Bool[Array, "pair x y place"] | None

    def __init__(self, guided: Any) -> None:
        self.guided = tuple(guided)
        if not self.guided:
            raise InputError("multistatic: there is no pair of a source and a receiver; expected one or more.")
        if len({each.mesh.grid for each in self.guided}) > 1:
            raise InputError("multistatic: pairs have different grids; expected one.")
        steps = [each.mesh.sonar.delay.step / each.mesh.finer[0] for each in self.guided]
        self.order = tuple(int(number) for number in np.argsort(steps, kind="stable"))
        self.audible = None
        pairs = [each.mesh.sonar.pair for each in self.guided]
        fixed = [pair for pair in pairs if pair is not None]
        if len(fixed) == len(pairs):
            self.audible = eqx.filter_jit(_audible)(self.guided, fixed)

    @property
    def grid(self) -> Grid:
        """Cells."""
        return self.guided[0].mesh.grid

    @eqx.filter_jit
    def log_mean_ratio(self, scan: Pings) -> Float[Array, "..."]:
        """Log of the mean ratio of every cell, shape of the grid, 1 along axes that do not matter.

        Parameters
        ----------
        scan : returns of all pairs at one time.
        """
        return self._means(scan)

    @eqx.filter_jit
    def log_ratio(self, scan: Pings, states: Any) -> Real:
        """Natural log of p(returns | target at state) / p(returns | no target): the sum over the pairs that report."""
        every = [
            jnp.where(scan.reported[number], each.likelihood.log_ratio(ping, states), 0)
            for number, (each, ping) in enumerate(zip(self.guided, scan.pings, strict=True))
        ]
        return sum(every[1:], start=every[0])

    def part(
        self, scan: Pings, states: Any, log_weights: Float[Array, "*cells"]
    ) -> tuple[Float[Array, " return"], ...]:
        """As of `Guided.part`, for every pair."""
        return tuple(each.part(ping, states, log_weights) for each, ping in zip(self.guided, scan.pings, strict=True))

    def beside(
        self, scan: Pings, parts: tuple[Float[Array, "target return"], ...], existence: Float[Array, " target"]
    ) -> Pings:
        """Pings whose returns count as much less as others may account for them, pair by pair as of `Guided.beside`."""
        every = zip(self.guided, scan.pings, parts, strict=True)
        return dataclasses.replace(scan, pings=tuple(each.beside(ping, part, existence) for each, ping, part in every))

    def of_targets(
        self, scan: Pings, parts: tuple[Float[Array, "target return"], ...], existence: Float[Array, " target"]
    ) -> tuple[Float[Array, " return"], ...]:
        """Probability that each return is an echo of one of some targets, a pair each."""
        every = zip(self.guided, scan.pings, parts, strict=True)
        return tuple(each.of_targets(ping, part, existence) for each, ping, part in every)

    def alike(self, scan: Pings, states: Any, centres: Any) -> Bool[Array, "centre *cells"]:
        """Whether no pair that reports tells positions apart."""
        every = [
            each.alike(ping, states, centres) | ~scan.reported[number]
            for number, (each, ping) in enumerate(zip(self.guided, scan.pings, strict=True))
        ]
        return jnp.all(jnp.stack(every), axis=0)

    def simulate(self, scan: Pings, states: Any, present: Bool[Array, ""] | bool, key: PRNGKeyArray) -> Pings:
        """Returns as the likelihood of a state draws them, of all pairs that report."""
        keys = jax.random.split(key, len(scan.pings))
        drawn = [
            each.simulate(ping, states, present, key)
            for each, ping, key in zip(self.guided, scan.pings, keys, strict=True)
        ]
        pings = tuple(
            dataclasses.replace(ping, there=ping.there & scan.reported[number]) for number, ping in enumerate(drawn)
        )
        return dataclasses.replace(scan, pings=pings)

    @full_precision
    def _means(self, scan: Pings) -> Float[Array, "..."]:
        """`log_mean_ratio`, compiled with what calls it."""
        excesses = [excess_of(self.guided[number], scan.pings[number], scan.reported[number]) for number in self.order]
        audible = self.audible
        if audible is None or any(ping.pair is not None for ping in scan.pings):
            audible = _audible(
                self.guided, [excesses[self.order.index(number)].pair for number in range(len(excesses))]
            )
        quiet = _quiet(excesses, audible[jnp.array(self.order)])
        near = [_near(number, excesses) for number in range(len(excesses))]
        across = [
            log_crossed(excesses, first, second) for first, second in itertools.combinations(range(len(excesses)), 2)
        ]
        lost = sum(each.lost for each in near)
        logs = [jnp.log(jnp.maximum(quiet - lost, 0)), *(each.log_sum for each in near), *across]
        total = jax.nn.logsumexp(jnp.stack(jnp.broadcast_arrays(*logs)), axis=0)
        # What the points of one pair take from the default another's may have taken too.
        over = jnp.log(jnp.maximum(lost - quiet, 0)) - total
        means = total + jnp.log1p(-jnp.exp(jnp.minimum(over, np.log1p(-LEAST))))
        meshes = [each.mesh for each in self.guided]
        mesh = next((each for each in meshes if each.sonar.doppler is not None), meshes[0])
        return mesh.on_grid(means)


class _Sums(NamedTuple):
    """What the points near the returns of one pair have: log of their sum, and what it stands in place of."""

    log_sum: Float[Array, "x y velocity"]
    lost: Float[Array, "x y velocity"]


def _audible(guided: tuple[Guided, ...], pairs: list[Bistatic]) -> Bool[Array, "pair x y place"]:
    """Whether pairs hear delays from places of every position cell."""
    axes = guided[0].mesh.axes
    within = (np.arange(WITHIN) + 0.5) / WITHIN - 0.5
    off_x, off_y = (each.ravel() for each in np.meshgrid(within, within, indexing="ij"))
    x = jnp.asarray(axes["x"].values[:, None, None] + axes["x"].step * off_x, float)
    y = jnp.asarray(axes["y"].values[None, :, None] + axes["y"].step * off_y, float)
    x, y = jnp.broadcast_arrays(x, y)
    places = PlanarState(x, y, jnp.zeros(()), jnp.zeros(()))
    return jnp.stack([each.mesh.hears(pair.echo(places)[0]) for each, pair in zip(guided, pairs, strict=True)])


def _quiet(excesses: list[Excess], audible: Bool[Array, "pair x y place"]) -> Float[Array, "x y velocity"]:
    """Mean of the product of what pairs say far from their returns."""
    product: Any = 1.0
    for each, heard in zip(excesses, audible, strict=True):
        product = product * (1 + heard[..., None] * each.inside[:, :, None, :])
    return product.mean(axis=2)


def _near(number: int, excesses: list[Excess]) -> _Sums:
    """Points near the returns of one pair, with what the others say far from theirs."""
    mine, others = excesses[number], [each for place, each in enumerate(excesses) if place != number]
    mesh = mine.mesh
    points = mine.finer()
    told = jnp.where(points.used, points.log_ratio, -jnp.inf)
    cells = mine.inside.shape[0] * mine.inside.shape[1]
    peak = jnp.full(cells, -jnp.inf).at[points.cell.ravel()].max(told.max(axis=-1).ravel())
    peak = jnp.where(peak > -jnp.inf, peak, 0)
    relative = jnp.exp(told - peak[points.cell][..., None])
    weighted = jnp.stack([relative, jnp.where(points.used, mine.default, 0)]) * points.area[..., None]
    velocities = max(each.inside.shape[-1] for each in excesses)
    shifts = mine.near.doppler

    def add(block: Array, sums: Float[Array, "cell both velocity"]) -> Float[Array, "cell both velocity"]:
        """Points of a few returns, every one into the velocities of its position cell."""
        returns = block * AT_ONCE + jnp.arange(AT_ONCE)
        x, y, cell = points.x[returns], points.y[returns], points.cell[returns]
        edges = shifts[returns, :1] + jnp.arange(shifts.shape[1] + 1) - 0.5
        shares = mesh.shares(mesh.spread(mine.pair, x, y), edges[:, None, None, :])
        counts = jnp.where(mine.there[returns] & (returns < len(mine.there)), 1.0, 0.0)[:, None, None, None]
        rows = jnp.einsum("rdbnv,krdbn->rdbkv", shares, weighted[:, returns] * counts)
        for each in others:
            rows = rows * each.quiet_at(x, y, cell)[..., None, :]
        return sums.at[cell].add(rows)

    sums = jnp.zeros((cells, 2, velocities), relative.dtype)
    sums = jax.lax.fori_loop(0, -(-mine.there.sum() // AT_ONCE), add, sums) / mesh.cell_area
    shape = *mine.inside.shape[:2], velocities
    return _Sums((peak[:, None] + jnp.log(sums[:, 0])).reshape(shape), sums[:, 1].reshape(shape))
