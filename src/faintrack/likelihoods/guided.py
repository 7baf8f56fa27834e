r"""The mean of a likelihood ratio over the cells of a grid, sampled where the returns are.

The ratio of a sonar's returns varies over a metre of range where a cell of a grid is a kilometre wide. What a cell
needs is the mean over its states, and what varies there lies near the returns (aughenbaugh2010, section 4). So the
ratio is taken at points of a mesh of measurements (`faintrack.likelihoods.mesh`), but only in a swath around every
return, and where swaths overlap once. The others have the value that a point far from any return has; points that the
sonar cannot hear have the ratio 1. With :math:`A_k` the area that point k stands for, in position and velocity,

.. math::
    \bar\ell(C) = \frac{1}{\sum_{k \in C} A_k} \left[ \sum_{k \in C,\, \text{near}} A_k \ell_k
    + \sum_{k \in C,\, \text{far}} A_k \ell_\text{default} + \sum_{k \in C,\, \text{unheard}} A_k \right]

(eq. 20, with the areas that it leaves to the reader). A cell without a point of the mesh has the ratio of its middle.

The error is that of a sum over mesh points in place of an integral. In cells that a loud return only grazes with what
lies outside its swath the mean is too small, by a factor that may be large and of a value that is small beside that of
the cells next to it. In float32 a velocity cell whose mean is less than e^-87 of the best of its own position has the
default value.
"""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError
from faintrack.likelihoods.exceedances import ExceedanceLikelihood, quiet_bin, quiet_tables, rated
from faintrack.likelihoods.mesh import Mesh
from faintrack.numerics.precision import full_precision
from faintrack.sensors.active import Ping
from faintrack.sensors.bistatic import Bistatic

CELLS = 1.5
"""Cells apart from which on a grid tells targets from each other."""

AT_ONCE = 8
"""Returns that are taken in at a time."""

ROWS = 128
"""Returns that are held against all others at a time."""

Real = Float[Array, "..."]


class Cover(NamedTuple):
    """What cells hold when there are no returns.

    Attributes
    ----------
    area : of the mesh points in every position cell; m^2.
    default : mean ratio of every cell.
    inside : ratio far from any return, less 1, of the velocities of a cell whose delays are heard.
    empty : whether there is no point in a position cell whose middle is heard.
    """

    area: Float[Array, "x y"]
    default: Float[Array, "x y velocity"]
    inside: Float[Array, "x y velocity"]
    empty: Bool[Array, "x y"]


class Near(NamedTuple):
    """Mesh points around the returns.

    Attributes
    ----------
    log_ratio : of each point.
    used : whether it is a point that no earlier return has too, in a bin of the sonar.
    delay, bearing, doppler : numbers of the points along each axis.
    """

    log_ratio: Float[Array, "return delay bearing doppler"]
    used: Bool[Array, "return delay bearing doppler"]
    delay: Int[Array, "return delay"]
    bearing: Int[Array, "return bearing"]
    doppler: Int[Array, "return doppler"]


class Guided(eqx.Module):
    """Log of the mean ratio of every cell of a grid, from samples near the returns.

    Attributes
    ----------
    likelihood : of a state.
    mesh : points at which the ratio is taken, and the grid.
    swath : bins on either side of a return, in delay, bearing and Doppler, that are sampled.
    tables : what a return tells at an offset, by class of fading: constant part, factor of its power, whether it is
        within the swath, and what the bin tells when it is quiet.
    quiets : what quiet bins tell at a mesh point, by class of fading; see
        `faintrack.likelihoods.exceedances.quiet_table`.
    far : ratio far from any return, between the ends of the delays: mean over the places in a bin, by class and place
        of Doppler.
    cover : of the fixed source and receiver; None where they move.

    Raises
    ------
    InputError : a grid without an axis that is needed, a swath below 0 or half around and more, or no point a bin.

    Examples
    --------
    >>> import math
    >>> from faintrack.beliefs.axis import Axis, between
    >>> from faintrack.sensors.active import ActiveSonar, Pulse, ping
    >>> from faintrack.sensors.bistatic import fixed
    >>> from faintrack.targets.states import PlanarState
    >>> pair = Bistatic(fixed(0.0, 0.0), fixed(0.0, 5000.0))
    >>> pulse = Pulse(2350.0, 1.0, 400.0, factor=1.0)
    >>> sonar = ActiveSonar(pulse, Axis(4.334, 29.717 / 18000, 18000), 72, math.radians(5), None, pair)
    >>> likelihood = ExceedanceLikelihood(sonar, snr=8.9, threshold=10.0)
    >>> place = between(-33e3, 33e3, 51)
    >>> grid = Grid(PlanarState, (("x", place), ("y", place)))
    >>> heard = ping(sonar, 0.0, np.array([[7000, 18, 0]]), np.array([25.0]), capacity=8)
    >>> guided = Guided(likelihood, grid)
    >>> means = guided.log_mean_ratio(heard)
    >>> means.shape, round(float(means.max()), 1), int(guided.samples(heard))
    ((51, 51), 10.7, 275)
    """

    likelihood: ExceedanceLikelihood
    mesh: Mesh
    swath: tuple[int, int, int] = eqx.field(static=True)
    tables: Float[Array, "fade 4 _ _ _"]
    quiets: Float[Array, "fade _ _ _ _ _"]
    far: Float[Array, "_ _"]
    cover: Cover | None

    def __init__(
        self,
        likelihood: ExceedanceLikelihood,
        grid: Grid,
        swath: tuple[int, int, int] = (5, 3, 3),
        finer: tuple[int, int, int] = (1, 4, 1),
    ) -> None:
        sonar = likelihood.sonar
        if min(swath) < 0 or 2 * swath[1] >= sonar.beams:
            raise InputError(f"guided: swath {swath}; expected at least 0, and less than half of the beams.")
        self.likelihood, self.mesh = likelihood, Mesh(sonar, grid, finer)
        self.swath = swath if sonar.doppler is not None else (*swath[:2], 0)
        self.tables = self._offset_tables()
        self.quiets = quiet_tables(likelihood, self.mesh.finer)
        places = self._over_fading(self.quiets)[self.quiets.shape[1] // 2, : self.mesh.finer[0], : self.mesh.finer[1]]
        self.far = jnp.exp(places).mean(axis=(0, 1))
        self.cover = None
        if sonar.pair is not None:
            self.cover = eqx.filter_jit(cover_of)(self.mesh, self.far, sonar.pair)

    @eqx.filter_jit
    def log_mean_ratio(self, ping: Ping) -> Float[Array, "..."]:
        """Log of the mean ratio of every cell, shape of the grid, 1 along axes that do not matter.

        Parameters
        ----------
        ping : returns of one ping.
        """
        arrays, others = eqx.partition(self, eqx.is_array)

        # Side by side, runs would wait for the one with the most returns and copy their sums in every turn of its loop.
        @jax.custom_batching.sequential_vmap
        def means(arrays: Guided, ping: Ping) -> Float[Array, "..."]:
            return eqx.combine(arrays, others)._means(ping)

        return means(arrays, ping)

    def part(self, ping: Ping, states: Any, log_weights: Float[Array, "*cells"]) -> Float[Array, " return"]:
        """Expected echoes of a target in the bin of every return, :math:`w(x_k, y_k) A_k` of `beside`."""
        mesh, sonar = self.mesh, self.likelihood.sonar
        pair = sonar.geometry(ping)
        number = ping.bins[:, 0] * mesh.finer[0]
        bearing = ping.bins[:, 1] * (2 * jnp.pi / sonar.beams)
        x, y = pair.position(mesh.delay(number), bearing)
        half = mesh.finer[0] / 2
        area = mesh.finer[1] * (mesh.sector(pair, number + half, bearing) - mesh.sector(pair, number - half, bearing))
        along_x, along_y = mesh.axes["x"], mesh.axes["y"]
        places = [jnp.asarray(along_x.place(x)), jnp.asarray(along_y.place(y))]
        density = self._positions(log_weights) / (along_x.step * along_y.step)
        return area * jax.scipy.ndimage.map_coordinates(density, places, 1)

    def beside(self, ping: Ping, parts: Float[Array, "target return"], existence: Float[Array, " target"]) -> Ping:
        r"""Ping whose returns count as much less as others may account for them.

        Notes
        -----
        A return is one target's or the background's. Others put one into bin k with the probability

        .. math:: p_k = \sum_t q_t \, w_t(x_k, y_k) A_k

        with w the density of the target's position at the bin's place and A the area of the bin. If one target more is
        the source of a return, the others were missed, each with :math:`1 - P_D`,
        :math:`P_D = e^{-\eta / (1 + s)}`. With :math:`L_k` the ratio of a return's power as that of an echo to that of
        noise, it so tells less by

        .. math:: c_k = \log \left(1 + \frac{p_k L_k}{1 - P_D}\right):

        it is read as one whose power is less by :math:`c_k (1 + s) / s`, down to where an echo of the mean power s says
        nothing, :math:`\log(1 + s) (1 + s) / s`: at the threshold each bin of a loud echo would still speak for one
        target more. A return that is another's with the probability
        :math:`a_k = 1 - e^{-c_k}` brings others in the bins that its echo spreads to, with the shares :math:`h_{jk}`:
        there the background is that of an echo of the power :math:`m = z_k h_{jk}`,

        .. math:: c_j \leftarrow c_j + \sum_k \log \left(1 - a_k + a_k \frac{e^{z_j m / (1 + m)}}{1 + m}\right).
        """
        gain = self.likelihood.snr / (1 + self.likelihood.snr)
        crowding = self._crowding(ping, existence @ parts)
        least = jnp.minimum(jnp.log1p(self.likelihood.snr) / gain, self.likelihood.threshold)
        power = jnp.maximum(ping.power - crowding / gain, least)
        return dataclasses.replace(ping, power=jnp.where(ping.there, power, ping.power))

    def of_targets(
        self, ping: Ping, parts: Float[Array, "target return"], existence: Float[Array, " target"]
    ) -> Float[Array, " return"]:
        """Probability that each return is an echo of one of some targets, :math:`a_k` of `beside`.

        Parameters
        ----------
        ping : returns of one ping.
        parts, existence : as of `beside`.
        """
        return jnp.where(ping.there, -jnp.expm1(-self._crowding(ping, existence @ parts)), 0)

    def _crowding(self, ping: Ping, expected: Float[Array, " return"]) -> Float[Array, " return"]:
        """What returns tell less beside as many echoes as are expected, c of `beside`."""
        likelihood, chance = self.likelihood, jnp.clip(expected, 0, 1)
        gain = likelihood.snr / (1 + likelihood.snr)
        echo = gain * ping.power - jnp.log1p(likelihood.snr)
        if ping.rate is not None:
            mean = 1 + likelihood.snr
            echo = echo + rated(quiet_bin(mean, likelihood.threshold), mean, ping.rate, likelihood.threshold)
        missed = 1 - jnp.exp(-likelihood.threshold / (1 + likelihood.snr))
        crowding = jnp.logaddexp(0.0, jnp.log(chance / missed) + echo)
        return crowding + self._companions(ping, -jnp.expm1(-crowding))

    def _companions(self, ping: Ping, of_others: Float[Array, " return"]) -> Float[Array, " return"]:
        """What returns tell less because others spread into their bins (the last equation of `beside`)."""
        sonar, number = self.likelihood.sonar, jnp.arange(len(ping.there))

        def of_one(mine: Int[Array, ""]) -> Real:
            off = ping.bins[mine] - ping.bins
            around = off[:, 1] - sonar.beams * jnp.round(off[:, 1] / sonar.beams)
            off = off.at[:, 1].set(around.astype(off.dtype))
            near = (jnp.abs(off) <= jnp.array(sonar.reach)).all(axis=-1) & (number != mine)
            near = near & ping.there & ping.there[mine]
            spread = jnp.where(near, sonar.response(*jnp.moveaxis(off.astype(ping.power.dtype), -1, 0)), 0)
            power = ping.power * spread
            echo = ping.power[mine] * power / (1 + power) - jnp.log1p(power)
            return jnp.sum(jnp.logaddexp(jnp.log1p(-of_others), jnp.log(of_others) + echo))

        return jax.lax.map(of_one, number, batch_size=ROWS)

    def _positions(self, log_weights: Float[Array, "*cells"]) -> Float[Array, "x y"]:
        """Probability of every position cell."""
        names = self.mesh.grid.names
        others = tuple(number for number, name in enumerate(names) if name not in ("x", "y"))
        weights = jnp.sum(jnp.exp(log_weights), axis=others)
        return weights if names.index("x") < names.index("y") else weights.T

    def alike(self, ping: Ping, states: Any, centres: Any) -> Bool[Array, "centre *cells"]:
        """Whether positions are as near each other as a cell and a beam tell."""
        pair, steps = self.likelihood.sonar.geometry(ping), dict(self.mesh.grid.axes)
        far = jnp.hypot(centres.x - pair.receiver.x, centres.y - pair.receiver.y)
        wide = far * self.likelihood.sonar.beam_width

        def along(name: str) -> Bool[Array, "centre *cells"]:
            values = getattr(states, name)
            among = (-1, *(1,) * values.ndim)
            reach = CELLS * steps[name].step + wide.reshape(among)
            return jnp.abs(values - getattr(centres, name).reshape(among)) <= reach

        return along("x") & along("y")

    def simulate(self, ping: Ping, states: Any, present: Bool[Array, ""] | bool, key: PRNGKeyArray) -> Ping:
        """Returns as the likelihood of a state draws them."""
        return self.likelihood.simulate(ping, states, present, key)

    @full_precision
    def _means(self, ping: Ping) -> Float[Array, "..."]:
        """`log_mean_ratio`, of one ping."""
        mesh, pair = self.mesh, self.likelihood.sonar.geometry(ping)
        cover = self.cover
        if ping.pair is not None or cover is None:
            cover = cover_of(mesh, self.far, pair)
        near = self.near(ping)
        bearing = (near.bearing * mesh.bearing_step)[:, None, :]
        x, y = pair.position(mesh.delay(near.delay[:, :, None]), bearing)
        inner, outer = (mesh.sector(pair, near.delay[:, :, None] + side, bearing) for side in (-0.5, 0.5))
        cell, on_grid = mesh.cell(x, y)
        used = near.used & on_grid[..., None]
        told = jnp.where(used, near.log_ratio, -jnp.inf)
        # Numbers are kept relative to the largest of each position cell: a loud return passes e^88.
        peak = jnp.full(cover.area.size, -jnp.inf).at[cell.ravel()].max(told.max(axis=-1).ravel())
        peak = jnp.where(peak > -jnp.inf, peak, 0)
        relative = jnp.exp(told - peak[cell][..., None])
        replaced = jnp.where(used, default_at(mesh, self.far, near.doppler)[:, None, None, :], 0)
        weighted = jnp.stack([relative, replaced]) * (outer - inner)[..., None]

        # What a loop reads is in memory; within it XLA would work the shifts out anew for every edge.
        spread = mesh.spread(pair, x, y)

        def add(block: Int[Array, ""], sums: Float[Array, "cell both_velocity"]) -> Float[Array, "cell both_velocity"]:
            """Points of a few returns, every one into the velocities of its position cell."""
            number = block * AT_ONCE + jnp.arange(AT_ONCE)
            edges = near.doppler[number, :1] + jnp.arange(near.doppler.shape[1] + 1) - 0.5
            shares = mesh.shares(jax.tree.map(lambda each: each[number], spread), edges[:, None, None, :])
            rows = jnp.einsum("rdbnv,krdbn->rdbkv", shares, weighted[:, number])
            return sums.at[cell[number]].add(rows.reshape(*rows.shape[:3], -1))

        nothing = jnp.zeros((cover.area.size, 2 * cover.default.shape[-1]), cover.area.dtype)
        sums = jax.lax.fori_loop(0, -(-ping.there.sum() // AT_ONCE), add, nothing).reshape(*cover.area.shape, 2, -1)
        sums = sums / jnp.where(cover.area > 0, cover.area, 1)[..., None, None]
        rest = jnp.maximum(cover.default - sums[..., 1, :], 0)
        means = jnp.logaddexp(jnp.log(rest), peak.reshape(*cover.area.shape, 1) + jnp.log(sums[..., 0, :]))
        means = jax.lax.cond(
            cover.empty.any(),
            lambda: jnp.where(cover.empty[..., None], self.likelihood.log_ratio(ping, mesh.middles()), means),
            lambda: means,
        )
        return mesh.on_grid(means)

    @eqx.filter_jit
    def samples(self, ping: Ping) -> Int[Array, ""]:
        """Number of mesh points at which the ratio of a ping is taken."""
        return self.near(ping).used.sum()

    @property
    def _steps(self) -> list[Int[np.ndarray, " step"]]:
        """Points of the swath along each axis."""
        return [np.arange(-s * each, s * each + 1) for each, s in zip(self.swath, self.mesh.finer, strict=True)]

    @property
    def _limits(self) -> tuple[int, ...]:
        """Points from one return to another from which on neither bears on the other."""
        reach = self.likelihood.sonar.reach
        return tuple(
            s * (max(r, each) + each) + 1 for r, each, s in zip(reach, self.swath, self.mesh.finer, strict=True)
        )

    def _over_fading(self, log_ratio: Float[Array, "fade ..."]) -> Real:
        """Log of the mean ratio over the classes of fading."""
        if len(log_ratio) == 1:
            return log_ratio[0]
        chances = jnp.asarray([chance for _, chance in self.likelihood.fading], log_ratio.dtype)
        return jax.nn.logsumexp(log_ratio, axis=0, b=chances.reshape(-1, *(1,) * (log_ratio.ndim - 1)))

    def _offset_tables(self) -> Float[Array, "fade 4 _ _ _"]:
        """What a return tells at the offsets that the swath of another return can have from it."""
        off = [
            np.arange(-(limit + steps[-1]), limit + steps[-1] + 1) / s
            for limit, steps, s in zip(self._limits, self._steps, self.mesh.finer, strict=True)
        ]
        mesh = np.meshgrid(*off, indexing="ij")
        response = float(self.likelihood.snr) * self.likelihood.sonar.tabled(*mesh)
        within = np.all([np.abs(each) <= s for each, s in zip(mesh, self.swath, strict=True)], axis=0)
        tables = []
        for power, _ in self.likelihood.fading:
            mean = 1 + power * response
            quiet = quiet_bin(mean, self.likelihood.threshold)
            tables.append(np.stack([-np.log(mean) - quiet, 1 - 1 / mean, within, quiet]))
        return jnp.asarray(np.stack(tables), float)

    def near(self, ping: Ping) -> Near:
        """Mesh points around the returns, and their ratio."""
        mesh, steps = self.mesh, self._steps
        shape = tuple(map(len, steps))
        place = ping.bins * jnp.array(mesh.finer)
        limits, number = jnp.array(self._limits), jnp.arange(len(place))
        # Returns ascend in delay: those that bear on one are neighbours in the list, and no pair is held in memory.
        delays = jnp.where(ping.there, ping.bins[:, 0], jnp.iinfo(jnp.int32).max // 2)
        span = (self._limits[0] - 1) // mesh.finer[0]
        first, last = jnp.searchsorted(delays, delays - span), jnp.searchsorted(delays, delays + span, side="right")

        def told_at(off: Int[Array, " 3"], other: Int[Array, ""]) -> tuple[Real, Real]:
            """What a return tells in the swath of one at an offset from it, and where that is in its own swath."""
            size = (len(self.tables), 4, *shape)
            table = jax.lax.dynamic_slice(self.tables, (0, 0, *(off + limits)), size)
            constant, factor, within, quiet = jnp.moveaxis(table, 1, 0)
            told = constant + factor * ping.power[other]
            if ping.rate is not None:
                told = told + rated(quiet, 1 / (1 - factor), ping.rate[other], self.likelihood.threshold)
            return told, within[0]

        def join(mine: Int[Array, ""], carried: tuple[Array, Array]) -> tuple[Array, Array]:
            def beside(other: Int[Array, ""], row: tuple[Array, Array]) -> tuple[Array, Array]:
                off = place[mine] - place[other]
                off = off.at[1].set((off[1] + mesh.around // 2) % mesh.around - mesh.around // 2)

                def added() -> tuple[Array, Array]:
                    told, within = told_at(off, other)
                    return row[0] + told, jnp.maximum(row[1], (within > 0) & (other < mine))

                close = (jnp.abs(off) < limits).all() & (other != mine)
                return jax.lax.cond(close, added, lambda: row)

            row = jax.lax.fori_loop(first[mine], last[mine], beside, (carried[0][mine], carried[1][mine]))
            return carried[0].at[mine].set(row[0]), carried[1].at[mine].set(row[1])

        own = jax.vmap(lambda number: told_at(jnp.zeros(3, jnp.int32), number)[0])(number)
        start = own, jnp.zeros((len(place), *shape), bool)
        total, twice = jax.lax.fori_loop(0, ping.there.sum(), join, start)

        delay, bearing, doppler = (place[:, axis, None] + steps[axis] for axis in range(3))
        bearing = bearing % mesh.around
        of_delay, in_delay = (each[:, :, None, None] for each in mesh.whole(delay, 0))
        of_doppler, in_doppler = (each[:, None, None, :] for each in mesh.whole(doppler, 2))
        in_beam = (bearing % mesh.finer[1])[:, None, :, None]
        quiet = self.quiets[:, of_delay, in_delay, in_beam, of_doppler, in_doppler]
        heard = mesh.heard(delay, 0)[:, :, None, None] & mesh.heard(doppler, 2)[:, None, None, :]
        used = ping.there[:, None, None, None] & heard & ~twice
        return Near(self._over_fading(jnp.moveaxis(total, 1, 0) + quiet), used, delay, bearing, doppler)


def default_at(mesh: Mesh, far: Float[Array, "_ _"], doppler: Int[Array, "..."]) -> Real:
    """Mean ratio far from any return at Doppler points; between the ends of the delays."""
    return far[mesh.whole(doppler, 2)]


@full_precision
def cover_of(mesh: Mesh, far: Float[Array, "_ _"], pair: Bistatic) -> Cover:
    """Areas and default values of all cells."""
    area, heard = mesh.areas(pair)
    share = jnp.where(area > 0, heard / jnp.where(area > 0, area, 1), 0)[..., None]
    # Points of Doppler far from the ends have one value: a strip for each end point, and one for all between.
    low, count = mesh.first(2), mesh.count(2)
    ends = mesh.finer[2] * (mesh.sonar.reach[2] + 1)
    starts = np.arange(count) if count <= 2 * ends + 1 else np.r_[: ends + 1, count - ends : count]
    edges = jnp.asarray(low + np.append(starts, count) - 0.5, float)
    middles = mesh.middles()
    shares = mesh.shares(mesh.spread(pair, middles.x[..., 0], middles.y[..., 0]), edges)
    inside = jnp.einsum("xysv,s->xyv", shares, default_at(mesh, far, jnp.asarray(low + starts)) - 1)
    within = mesh.hears(pair.echo(middles)[0])[..., 0]
    return Cover(area, 1 + share * inside, inside, (area == 0) & within)
