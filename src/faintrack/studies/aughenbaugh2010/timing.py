"""How long a measurement update takes, the first one and those after it."""

import time
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax

from faintrack.likelihoods.guided import Guided
from faintrack.likelihoods.random_points import RandomPoints
from faintrack.studies.aughenbaugh2010 import runs, scene

REPEATS = 5
"""Updates of which the fastest counts."""


def update_seconds(pulse: str, method: str) -> tuple[float, float]:
    """Seconds of the first update, with what can be used again, and of a later one; after compilation."""
    cells = scene.FINE if method.endswith("_fine") else scene.BASE
    model = scene.likelihood(pulse)
    pings, _ = jax.jit(lambda key: scene.pings(key, pulse))(jax.random.key(0))
    ping = jax.tree.map(lambda values: values[20], pings)

    def prepare() -> Any:
        if method.startswith("random"):
            return RandomPoints(model, scene.grid(cells), int(method[len("random")]), jax.random.key(0))
        return Guided(model, scene.grid(cells), runs.SWATH[pulse], runs.finer(cells))

    update = eqx.filter_jit(lambda means, ping: means.log_mean_ratio(ping))
    jax.block_until_ready(update(prepare(), ping))
    means, preparing = _timed(prepare)
    _, later = min((_timed(lambda: update(means, ping)) for _ in range(REPEATS)), key=lambda each: each[1])
    return preparing + later, later


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    start = time.perf_counter()
    done = jax.block_until_ready(work())
    return done, time.perf_counter() - start
