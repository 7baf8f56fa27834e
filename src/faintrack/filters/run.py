"""A filter over many scans, compiled as one loop."""

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief, update
from faintrack.likelihoods.protocols import CellMeans, Likelihood, Proposing, log_ratios
from faintrack.targets.target import Target


@runtime_checkable
class Filter(Protocol):
    """Starts a belief and carries it forward."""

    @property
    def target(self) -> Target:
        """What the filter believes of a target."""

    def init(self, key: PRNGKeyArray, time: float = 0.0) -> Belief:
        """Belief before any scan."""

    def predict(self, belief: Belief, time: Float[Array, ""], key: PRNGKeyArray) -> Belief:
        """Belief carried forward to `time`; seconds."""


@eqx.filter_jit
def step(
    filter: Filter,
    likelihood: Likelihood | CellMeans,
    belief: Belief,
    scan: Any,
    key: PRNGKeyArray,
    guided: bool = False,
) -> tuple[Belief, Float[Array, ""]]:
    """Predict to the time of a scan and take it in; returns the belief and the log evidence.

    With `guided`, newborn particles are drawn where the scan points, by a likelihood that can propose them.
    """
    proposed = {"guide": partial(likelihood.propose, scan)} if guided and isinstance(likelihood, Proposing) else {}
    predicted = filter.predict(belief, scan.time, key, **proposed)
    return update(predicted, log_ratios(likelihood, scan, predicted.states))


@eqx.filter_jit
def run(
    filter: Filter,
    likelihood: Likelihood | CellMeans,
    scans: Any,
    key: PRNGKeyArray,
    keep: Callable[[Belief], Any] = lambda belief: belief,
    start: Belief | None = None,
) -> tuple[Belief, Any, Float[Array, " scan"]]:
    """Filter a stack of scans.

    Parameters
    ----------
    filter, likelihood : what carries the belief, and what takes in a scan.
    scans : as many scans as the first axis of every field is long.
    key : every scan makes its own key from it; the same key gives the same bits. A batch of runs is `jax.vmap` over
        keys or scans; of runs on large grids, which together would not fit a core's cache, `jax.lax.map`.
    keep : what to keep of the belief after each scan; all of it where not given.
    start : belief before the first scan; what the filter begins with where not given.

    Returns
    -------
    The last belief; what was kept of every scan, stacked; the log evidence of every scan.
    """
    count = scans.time.shape[0]

    def advance(belief: Belief, indexed: tuple[Any, Array]) -> tuple[Belief, tuple[Any, Array]]:
        scan, number = indexed
        belief, log_evidence = step(filter, likelihood, belief, scan, jax.random.fold_in(key, number))
        return belief, (keep(belief), log_evidence)

    start = filter.init(jax.random.fold_in(key, count)) if start is None else start
    last, (kept, log_evidence) = jax.lax.scan(advance, start, (scans, jnp.arange(count)))
    return last, kept, log_evidence
