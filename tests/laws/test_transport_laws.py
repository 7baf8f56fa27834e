"""What every transport on a grid obeys, and every filter that uses one."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief, covariance, mean, update
from faintrack.beliefs.grids import Grid, surface
from faintrack.errors import InputError
from faintrack.filters.adi import alternating_directions
from faintrack.filters.cell_particles import CellParticles
from faintrack.filters.grid import GridFilter, Transport
from faintrack.filters.separable import separable, separable_unevenly
from faintrack.filters.shifts import Shifts
from faintrack.targets.motion import OrnsteinUhlenbeck, PlanarMotion
from faintrack.targets.states import PlanarState, RangeState
from faintrack.targets.target import Target
from tests.scenes import predict
from tests.tolerances import assert_equal, rounding

KEY = jax.random.key(5)
LINE = Grid(RangeState, (("range", Axis(-15.0, 1.0, 31)), ("range_rate", Axis(-1.0, 0.5, 5))))
PLANE = Grid(
    PlanarState,
    (("vx", Axis(-1.0, 1.0, 3)), ("vy", Axis(-0.5, 0.25, 5)), ("x", Axis(0.0, 1.0, 12)), ("y", Axis(-3.0, 0.5, 10))),
)
MOTION = PlanarMotion(0.3)


@eqx.filter_jit
def _carry(transport: Transport, log_weights: Any, start: Any, end: Any) -> tuple[Any, Any]:
    return transport.carry(log_weights, start, end, KEY)


def carry(transport: Transport, log_weights: Any, start: float, end: float) -> tuple[Any, Any]:
    return _carry(transport, log_weights, *(jnp.asarray(time, log_weights.dtype) for time in (start, end)))


def transports(grid: Grid) -> dict[str, Transport]:
    return {
        "shifts": Shifts(grid, 1.0, (0.1, 0.8, 0.1)),
        "separable": separable(grid, MOTION, 1.0),
        "unevenly": separable_unevenly(grid, MOTION, 0.8),
        "relaxing": separable(grid, OrnsteinUhlenbeck(0.3, 4.0), 1.0),
        "adi": alternating_directions(grid, 0.3, 1.0),
        "cell_particles": CellParticles(grid, MOTION, 1.0, 3),
    }


CASES = {
    (name, size): each for size, grid in (("line", LINE), ("plane", PLANE)) for name, each in transports(grid).items()
}
each_case = pytest.mark.parametrize("case", CASES, ids="-".join)


def grid_of(case: tuple[str, str]) -> Grid:
    return LINE if case[1] == "line" else PLANE


def filter_of(case: tuple[str, str], **more: Any) -> GridFilter:
    return GridFilter(grid_of(case), Target(None, MOTION, 0.02, 0.05), CASES[case], **more)


def bell(grid: Grid, dtype: type = np.float32) -> jnp.ndarray:
    """Log weights of a target near the middle of the grid."""
    states = grid.states(dtype)
    log_weights = jnp.zeros(grid.shape, dtype)
    for name, axis in grid.axes:
        middle = (axis.first + axis.last) / 2
        log_weights = log_weights - ((getattr(states, name) - middle) / (axis.count * axis.step / 8)) ** 2 / 2
    return log_weights - jax.nn.logsumexp(log_weights)


@each_case
def test_no_weight_is_made_or_lost(case: tuple[str, str], dtype: type) -> None:
    """What stays and what leaves sum to one, also where much leaves; every weight is a probability."""
    grid = grid_of(case)
    for log_weights in (bell(grid, dtype), jnp.full(grid.shape, -np.log(grid.size), dtype)):
        moved, log_lost = carry(CASES[case], log_weights, 0.0, 2.0)
        # A sum over the cells for each of two steps; the shares left out of an implicit step are given to others.
        assert_equal(np.exp(moved).sum() + np.exp(log_lost), 1.0, dtype, 4 * grid.size)
        assert not np.isnan(moved).any()


@each_case
def test_no_time_changes_nothing(case: tuple[str, str], dtype: type) -> None:
    log_weights = bell(grid_of(case), dtype)
    moved, log_lost = carry(CASES[case], log_weights, 3.0, 3.0)
    assert_equal(moved, log_weights, dtype, 10, scale=float(-log_weights.min()))
    assert log_lost == -np.inf


@each_case
def test_the_mean_moves_with_the_velocity(case: tuple[str, str]) -> None:
    """Every cell's target moves by its velocity, away from the edges and but for the velocity's own relaxation."""
    name, size = case
    if name == "relaxing":
        pytest.skip("its velocity decays; see the comparison with the Kalman filter")
    if case == ("adi", "plane"):
        pytest.skip("the tail of an implicit step leaves so small a grid")
    grid = grid_of(case)
    rate = -1.0 if size == "line" else 1.0
    component, speed = ("range", "range_rate") if size == "line" else ("x", "vx")
    start = jnp.full(grid.shape, -jnp.inf)
    index = tuple(int(axis.nearest(rate)) if part == speed else axis.count // 2 for part, axis in grid.axes)
    before = filter_of(case).init(KEY)
    belief = Belief(before.states, start.at[index].set(0.0), jnp.array(0.0), jnp.array(0.0))
    moved, _ = carry(CASES[case], belief.log_weights, 0.0, 1.0)
    after = Belief(before.states, moved, jnp.array(0.0), jnp.array(1.0))
    change = float(getattr(mean(after), component) - getattr(mean(belief), component))
    # Draws of one cell: three particles, their place in the cell a third of its width in each direction; at the edge
    # of the velocities the noise can only slow a target down.
    allowed = {"cell_particles": 5 * 0.7 / np.sqrt(3), "separable": 0.15, "unevenly": 0.15}.get(name, 1e-3)
    assert abs(change - rate) < allowed


@each_case
def test_probability_stays_probability(case: tuple[str, str]) -> None:
    for more in ({}, {"returns": True}, {"simplified": True}) if case == ("shifts", "line") else ({},):
        filter = filter_of(case, **more)
        belief = filter.init(KEY, existence=0.3)
        for number in range(1, 4):
            belief = predict(filter, belief, float(number), KEY)
            assert_equal(np.exp(belief.log_weights).sum(), 1.0, np.float32, 10 * grid_of(case).size)
            assert np.isfinite(belief.log_odds)
            belief, _ = update(belief, 40 * jnp.cos(jnp.arange(grid_of(case).size).reshape(grid_of(case).shape)))


@each_case
def test_two_steps_equal_one_of_twice_the_time(case: tuple[str, str]) -> None:
    """A step of several intervals is as many steps; existence is that of continuous time."""
    if case[0] == "cell_particles":
        pytest.skip("its draws differ")
    filter = filter_of(case)
    belief = filter.init(KEY, existence=0.3)
    belief = Belief(belief.states, bell(grid_of(case)), belief.log_odds, belief.time)
    twice, lost = carry(CASES[case], belief.log_weights, 0.0, 2.0)
    middle, first = carry(CASES[case], belief.log_weights, 0.0, 1.0)
    once, second = carry(CASES[case], middle, 1.0, 2.0)
    near = np.asarray(twice) > -30
    assert_equal(once[near], twice[near], np.float32, 100, scale=30.0)
    np.testing.assert_allclose(np.exp(lost), np.exp(first) + np.exp(second), atol=1e-6)


def test_a_target_that_leaves_is_absent_or_returns() -> None:
    """The last cell of a fast target: with no departures of its own the grid's edge is the only way to leave."""
    shifts = Shifts(LINE, 1.0)
    target = Target(None, MOTION, 0.0, 0.0)
    log_weights = jnp.full(LINE.shape, -jnp.inf).at[-1, -1].set(np.log(0.25)).at[15, 2].set(np.log(0.75))
    leaves, returns = (GridFilter(LINE, target, shifts, returns=each) for each in (False, True))
    belief = leaves.init(KEY, existence=0.8)
    belief = Belief(belief.states, log_weights, belief.log_odds, belief.time)
    gone = predict(leaves, belief, 1.0, KEY)
    np.testing.assert_allclose(gone.existence, 0.6, rtol=rounding(np.float32, 20))
    np.testing.assert_allclose(np.exp(gone.log_weights[15, 2]), 1.0, rtol=rounding(np.float32, 20))
    back = predict(returns, belief, 1.0, KEY)
    np.testing.assert_allclose(back.existence, 0.8, rtol=rounding(np.float32, 20))
    np.testing.assert_allclose(np.exp(back.log_weights[0, 0]), 0.25 / LINE.size, rtol=rounding(np.float32, 200))


def test_the_simplified_recursion_is_exact_where_the_flows_balance() -> None:
    """Eq. 20: as much flows to absence as from it. Then both recursions give the same surface."""
    transport = Shifts(LINE, 1.0, (0.1, 0.8, 0.1))
    arrival, departure, existence = 0.02, 0.06, 0.25
    target = Target(None, MOTION, arrival, departure)
    full, simple = (GridFilter(LINE, target, transport, simplified=each) for each in (False, True))
    belief = full.init(KEY, existence=existence)
    # Narrow, so that nothing leaves by the edges.
    narrow = 9 * bell(LINE)
    belief = Belief(belief.states, narrow - jax.nn.logsumexp(narrow), belief.log_odds, belief.time)
    # arrival x absence = departure x presence, so that existence stands still.
    exact, approximate = predict(full, belief, 1.0, KEY), predict(simple, belief, 1.0, KEY)
    np.testing.assert_allclose(exact.existence, existence, rtol=rounding(np.float32, 50))
    near = np.asarray(exact.log_weights) > -40
    assert_equal(surface(approximate)[near], surface(exact)[near], np.float32, 50, scale=40.0)
    # Out of balance it is wrong by the factor by which absence changes.
    unlikely = full.init(KEY, existence=0.9)
    exact, approximate = predict(full, unlikely, 1.0, KEY), predict(simple, unlikely, 1.0, KEY)
    factor = (1 - exact.existence) / (1 - 0.9)
    assert factor > 1.3
    assert_equal(approximate.log_odds - exact.log_odds, np.log(factor), np.float32, 100, scale=1.0)


@pytest.mark.parametrize("motion", [MOTION, OrnsteinUhlenbeck(0.3, 4.0)], ids=["velocity", "relaxing"])
def test_kernels_and_particles_from_every_cell_agree(motion: Any) -> None:
    """The kernel is the mean of the particles: 400 a cell, five standard errors of a count."""
    grid = Grid(RangeState, (("range", Axis(-5.0, 0.5, 21)), ("range_rate", Axis(-1.5, 0.5, 7))))
    start = bell(grid)
    count = 400
    exact, lost = carry(separable(grid, motion, 1.0), start, 0.0, 1.0)
    drawn, lost_drawn = carry(CellParticles(grid, motion, 1.0, count), start, 0.0, 1.0)
    # Every particle carries a weight of at most w / count, so the variance of a cell is at most w x cell / count.
    error = np.sqrt(np.exp(float(start.max())) * np.exp(np.asarray(exact)) / count)
    np.testing.assert_array_less(np.abs(np.exp(drawn) - np.exp(exact)), 5 * error + 1e-7)
    assert abs(np.exp(lost) - np.exp(lost_drawn)) < 5 * np.sqrt(np.exp(float(start.max())) * np.exp(lost) / count)


FINE = Grid(RangeState, (("range", Axis(-20.0, 0.25, 177)), ("range_rate", Axis(-3.0, 0.2, 41))))
COARSE = Grid(RangeState, (("range", Axis(-30.0, 1.5, 45)), ("range_rate", Axis(-3.0, 0.2, 41))))


def moved_bell(transport: Any) -> tuple[Belief, Belief]:
    """A normal belief on the transport's grid, and what a second makes of it."""
    states = transport.grid.states()
    log_weights = -((states.range - 2) ** 2) / 8 - (states.range_rate - 1) ** 2 / (2 * 0.49)
    filter = GridFilter(transport.grid, Target(None, MOTION, 0.0, 0.0), transport)
    start = filter.init(KEY, existence=0.5)
    belief = Belief(states, log_weights - jax.nn.logsumexp(log_weights), start.log_odds, start.time)
    return belief, predict(filter, belief, 1.0, KEY)


@pytest.mark.parametrize("motion", [MOTION, OrnsteinUhlenbeck(0.3, 4.0)], ids=["velocity", "relaxing"])
def test_kernels_move_as_the_kalman_filter_does(motion: Any) -> None:
    """Mean and covariance are predicted; the cells add to the variances, by no more than the module says."""
    before, after = moved_bell(separable(FINE, motion, 1.0))
    step = motion.step(1.0)
    transition = np.array([[1, step.gain], [0, step.decay]])
    noise = np.array([[step.a**2 + step.b**2, step.a * step.c], [step.a * step.c, step.c**2]])
    expected = transition @ np.array([mean(before).range, mean(before).range_rate])
    # Velocities at the ends of the grid, five standard deviations off, are held there.
    np.testing.assert_allclose([mean(after).range, mean(after).range_rate], expected, atol=1e-3)
    excess = np.asarray(covariance(after)) - (transition @ np.asarray(covariance(before)) @ transition.T + noise)
    rounded = 1e-3
    assert -rounded < excess[0, 0] < 0.25**2 / 4 + 0.2**2 / 12 + rounded
    assert -rounded < excess[1, 1] < 0.2**2 / 6 + rounded


def test_implicit_steps_smear_as_much_as_the_equations_say() -> None:
    """A geometric number of cells c has the mean c and the variance c + c^2; the velocity then diffuses by q T."""
    before, after = moved_bell(alternating_directions(COARSE, 0.3, 1.0))
    speed = mean(before).range_rate
    squared = covariance(before)[1, 1] + speed**2
    magnitude = np.sum(np.exp(before.log_weights) * np.abs(before.states.range_rate))
    expected = covariance(before)[0, 0] + covariance(before)[1, 1] + magnitude * 1.5 + squared
    np.testing.assert_allclose(mean(after).range, mean(before).range + speed, atol=1e-3)
    np.testing.assert_allclose(covariance(after)[0, 0], expected, rtol=1e-3)
    np.testing.assert_allclose(covariance(after)[1, 1], covariance(before)[1, 1] + 0.3**2, rtol=1e-4)


def test_substeps_come_closer_to_the_equation() -> None:
    """The second term of the smear, (v T)^2, falls with their number."""
    smears = [covariance(moved_bell(alternating_directions(COARSE, 0.0, 1.0, n))[1])[0, 0] for n in (1, 2, 4)]
    first, second, third = (float(smear) for smear in smears)
    np.testing.assert_allclose(second - third, (first - second) / 2, rtol=0.01)


@pytest.mark.parametrize("axes", [("vx", "vy", "x", "y"), ("x", "vx", "vy", "y"), ("y", "x", "vy", "vx")], ids="-".join)
@pytest.mark.parametrize("substeps", [1, 3])
def test_implicit_steps_solve_the_equations(axes: tuple[str, ...], substeps: int) -> None:
    """Against solving for the weights after each substep, one axis after the other; what is left out is shared out."""
    grid = Grid(PlanarState, tuple((name, dict(PLANE.axes)[name]) for name in axes))
    transport = alternating_directions(grid, 0.3, 1.0, substeps)
    log_weights = jax.random.normal(KEY, grid.shape)
    moved, log_lost = carry(transport, log_weights, 0.0, 1.0)
    expected = np.exp(np.asarray(log_weights, float))
    before = expected.sum()
    for place, rate in grid.pairs:
        (_, along), (_, speed) = grid.axes[place], grid.axes[rate]
        front = np.moveaxis(expected, (rate, place), (0, 1))
        shape = front.shape
        front = front.reshape(*shape[:2], -1).copy()
        spread = 0.3**2 / substeps / (2 * speed.step**2)
        beside = np.eye(speed.count, k=1) + np.eye(speed.count, k=-1)
        diffusion = np.eye(speed.count) + spread * (np.diag(beside.sum(axis=0)) - beside)
        for number, velocity in enumerate(speed.values):
            courant = abs(velocity) / substeps / along.step
            stream = np.eye(along.count) * (1 + courant) - courant * np.eye(along.count, k=-1 if velocity > 0 else 1)
            for _ in range(substeps):
                front[number] = np.linalg.solve(stream, front[number])
        for _ in range(substeps):
            front = np.linalg.solve(diffusion, front.reshape(len(front), -1)).reshape(front.shape)
        expected = np.moveaxis(front.reshape(shape), (0, 1), (rate, place))
    np.testing.assert_allclose(np.exp(moved), expected, rtol=1e-4, atol=1e-4 * expected.mean())
    np.testing.assert_allclose(np.exp(log_lost), before - expected.sum(), rtol=1e-4)


def test_what_crosses_the_grid_in_a_step_has_left_it() -> None:
    """Rates of 500 cells a step and none: those leave, this one stays, and nothing is not a number."""
    grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 10)), ("range_rate", Axis(-500.0, 500.0, 3))))
    moved, log_lost = carry(alternating_directions(grid, 0.0, 1.0, 1000), jnp.full(grid.shape, -np.log(30.0)), 0.0, 1.0)
    np.testing.assert_allclose(np.exp(moved), np.tile([0, 1 / 30, 0], (10, 1)), rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(np.exp(log_lost), 2 / 3, rtol=1e-5)


def test_slow_targets_keep_their_course() -> None:
    """A fifteenth of a cell a step (stone2002, 4.2): after 150 steps ten cells, and all in one."""
    grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 40)), ("range_rate", Axis(0.0, 1 / 15, 2))))
    log_weights = jnp.full(grid.shape, -jnp.inf).at[3, :].set(np.log(0.5))
    log_weights, _ = carry(Shifts(grid, 1.0), log_weights, 0.0, 150.0)
    np.testing.assert_allclose(np.exp(log_weights[[3, 13], [0, 1]]), 0.5, rtol=1e-5)


def test_axes_that_do_not_belong_together_are_refused() -> None:
    for axes in ((("vx", Axis(0.0, 1.0, 3)), ("y", Axis(0.0, 1.0, 3))), (("x", Axis(0.0, 1.0, 3)),)):
        with pytest.raises(InputError, match=r"grid axes .* expected"):
            Grid(PlanarState, axes).pairs  # noqa: B018
    with pytest.raises(InputError, match="grid axis range: expected one of x, y, vx, vy"):
        Grid(PlanarState, (("range", Axis(0.0, 1.0, 3)),))
    with pytest.raises(InputError, match="plant is"):
        Shifts(LINE, 1.0, (0.5, 0.5))
    with pytest.raises(InputError, match="step -1 and count 3"):
        Axis(0.0, -1.0, 3)


@pytest.mark.parametrize("motion", [MOTION, OrnsteinUhlenbeck(0.3, 4.0)], ids=["nearly constant", "relaxing"])
def test_an_uneven_interval_has_the_kernel_of_its_length(motion: Any, dtype: type) -> None:
    """As of one step of just that length, for a step; of a usual interval as evenly."""
    unevenly, start = separable_unevenly(LINE, motion, 1.0), bell(LINE, dtype)
    for interval, steps in ((1.0, 1), (0.95, 1), (1.05, 1), (1.4, 1), (0.1, 1), (3.2, 3)):
        moved, log_lost = carry(unevenly, start, 7.0, 7.0 + interval)
        expected, expected_lost = carry(separable(LINE, motion, interval / steps), start, 0.0, interval)
        # Times of single precision differ by 5e-7, and second differences of the displacement by as much.
        np.testing.assert_allclose(np.exp(moved), np.exp(expected), atol=2e-5)
        np.testing.assert_allclose(np.exp(log_lost), np.exp(expected_lost), atol=2e-5)
