"""The model of a run on many workers, against what can be said of any such run."""

import numpy as np
import pytest

from faintrack.archive.duration import TASK, duration


@pytest.mark.parametrize("workers", [1, 7, 1000])
def test_a_run_lasts_as_long_as_what_limits_it(workers: int) -> None:
    """Never shorter than the work shared evenly, the longest chain, or the scheduler; Graham's bound from above."""
    drawn = np.random.default_rng(workers)
    chains = [drawn.uniform(1, 9, drawn.integers(1, 30)).tolist() for _ in range(3000)]
    tasks, work = sum(map(len, chains)), sum(map(sum, chains))
    longest = max(sum(chain) + TASK * len(chain) for chain in chains)
    least = max(work / workers, longest, tasks * TASK)
    assert least <= duration(chains, workers)
    assert duration(chains, workers, task=0.0) <= work / workers + longest


def test_one_worker_and_one_chain_take_all_one_after_the_other() -> None:
    assert duration([[2.0, 3.0], [4.0]], 1) == pytest.approx(9 + 3 * TASK)
    assert duration([[2.0, 3.0]], 1000) == pytest.approx(5 + 2 * TASK)
    assert duration([], 5) == 0


def test_short_segments_are_limited_by_the_scheduler() -> None:
    """From segments of workers times a task on, 3.3 s of a thousand, the scheduler is what a run lasts."""
    chains = [[1.0] * 10 for _ in range(5000)]
    assert duration(chains, 1000) == pytest.approx(50_000 * TASK, rel=0.02)
    chains = [[33.0] * 10 for _ in range(5000)]
    assert duration(chains, 1000) == pytest.approx(5 * 330, rel=0.02)


def test_a_year_of_four_stations_on_a_thousand_workers() -> None:
    """The table of the page on scale: 180 s an hour, 30 s of burn-in."""
    for hours, expected in ((24, 2.42), (12, 1.83), (6, 1.85), (1, 2.10)):
        chains = [[210.0] + [180.0] * (hours - 1)] * (4 * 365 * 24 // hours)
        assert duration(chains, 1000) / 3600 == pytest.approx(expected, abs=0.005)
