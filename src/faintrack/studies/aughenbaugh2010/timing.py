"""How long a measurement update takes, the first one and those after it."""

from typing import Any

import equinox as eqx
import jax

from faintrack.likelihoods.guided import Guided
from faintrack.likelihoods.random_points import RandomPoints
from faintrack.studies.aughenbaugh2010 import runs, scene
from faintrack.studies.rows import seconds

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
    means = prepare()
    jax.block_until_ready(update(means, ping))
    later = min(seconds(lambda: update(means, ping)) for _ in range(REPEATS))
    return seconds(prepare) + later, later
