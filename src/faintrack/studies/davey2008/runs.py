"""Runs of the study: the same frames through each of the four trackers."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.baselines.viterbi import follow
from faintrack.beliefs.belief import Belief, mean
from faintrack.filters.run import run
from faintrack.likelihoods.cells import CellLikelihood
from faintrack.likelihoods.within import Within
from faintrack.sensors.cells import CellScan
from faintrack.studies.davey2008 import scene

Followed = tuple[Float[Array, " scan"], Float[Array, "scan 2"]]
"""What is thresholded, and the place (x, y), of every frame."""


def by_grid(model: CellLikelihood, scans: CellScan, key: PRNGKeyArray) -> Followed:
    """Bayes on the grid."""
    return run(scene.scene().grid, scene.PixelMean(model), scans, key, _known)[1]


def by_viterbi(model: CellLikelihood, scans: CellScan, key: PRNGKeyArray) -> Followed:
    """Dynamic programming on the same grid."""
    score, state = follow(scene.scene().viterbi, scene.PixelMean(model), scans)
    return score, jnp.stack([state.x, state.y], axis=-1)


def by_particles(model: CellLikelihood, scans: CellScan, key: PRNGKeyArray) -> Followed:
    """Bernoulli particle filter; a particle out of the image is none."""
    return run(scene.scene().particles, Within(model, model.cells), scans, key, _known)[1]


def by_pmht(model: CellLikelihood, scans: CellScan, key: PRNGKeyArray) -> Followed:
    """Histogram PMHT on the amplitudes."""
    score, state = scene.tracks(model.level).follow(scene.shots(scans))
    return score, state[..., 0]


METHODS: dict[str, Callable[[CellLikelihood, CellScan, PRNGKeyArray], Followed]] = {
    "grid": by_grid,
    "viterbi": by_viterbi,
    "particle": by_particles,
    "pmht": by_pmht,
}
"""What is compared, by key."""


def compare(key: PRNGKeyArray, snr_db: Array, present: Array) -> dict[str, Array]:
    """One run: the target's speed; what is thresholded, and the distance of the place from the path, by each method.

    Pixels, and pixels a frame.
    """
    model = scene.likelihood(snr_db)
    for_scans, for_filter = jax.random.split(key)
    scans, path = scene.look(for_scans, model, present)
    kept: dict[str, Array] = {"speed": jnp.hypot(*(path[1] - path[0]))}
    for name, method in METHODS.items():
        kept[f"{name}_statistic"], place = method(model, scans, for_filter)
        kept[f"{name}_error"] = jnp.hypot(*(place - path).T)
    return kept


def _known(belief: Belief) -> Any:
    middle = mean(belief)
    return belief.log_odds, jnp.stack([middle.x, middle.y])
