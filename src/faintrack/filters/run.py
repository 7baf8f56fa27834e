"""A filter over many scans, compiled as one loop."""

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief, update
from faintrack.filters.guide import guide
from faintrack.targets.target import Target


@runtime_checkable
class Filter(Protocol):
    """Starts a belief and carries it forward."""

    @property
    def target(self) -> Target:
        """What the filter believes of a target."""

    def init(self, key: PRNGKeyArray, time: float = 0.0) -> Belief:
        """Belief before any scan."""

    def predict(self, belief: Belief, time: Any, key: PRNGKeyArray) -> Belief:
        """Belief carried forward to `time`."""


@runtime_checkable
class Likelihood(Protocol):
    """Says how much likelier a scan is with a target at each state than without one."""

    def log_ratio(self, scan: Any, states: Any) -> Array:
        """Natural log of p(scan | target at state) / p(scan | no target)."""


Proposal = Callable[..., tuple[Any, Array]]
"""Function of (likelihood, scan, birth, key, count) to newborn states and their log weights: `guide`, or its like."""


@eqx.filter_jit
def step(
    filter: Filter,
    likelihood: Likelihood,
    belief: Belief,
    scan: Any,
    key: PRNGKeyArray,
    guided: bool | Proposal = False,
) -> tuple[Belief, Float[Array, ""]]:
    """Predict to the time of a scan and take it in; returns the belief and the log evidence.

    With `guided`, newborn particles are drawn where the scan points: by `faintrack.filters.guide`, or as a function
    such as `faintrack.filters.guide_bearings.along_bearings` does.
    """
    propose = guide if guided is True else guided
    more = {"guide": partial(propose, likelihood, scan)} if propose else {}
    predicted = filter.predict(belief, scan.time, key, **more)
    return update(predicted, likelihood.log_ratio(scan, predicted.states))


@eqx.filter_jit
def run(
    filter: Filter,
    likelihood: Likelihood,
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
