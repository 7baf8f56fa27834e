"""Runs of the study: new noise on the one truth, followed by the tracker."""

import jax
from jaxtyping import Array, PRNGKeyArray

from faintrack.studies.superposed import scene


def births1(key: PRNGKeyArray) -> dict[str, Array]:
    """One run with targets that appear anywhere about the middle."""
    return _followed(key, 1)


def births2(key: PRNGKeyArray) -> dict[str, Array]:
    """One run with targets that appear near five known places."""
    return _followed(key, 5)


def _followed(key: PRNGKeyArray, sites: int) -> dict[str, Array]:
    """Existence and place, metres, of every slot after every scan."""
    for_scans, for_start, for_tracker = jax.random.split(key, 3)
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        tracker = scene.tracker(sites)
    estimates = tracker.steps(tracker.init(for_start), scene.look(for_scans), for_tracker)[1]
    return {"existence": estimates.existence, "x": estimates.mean.x, "y": estimates.mean.y}
