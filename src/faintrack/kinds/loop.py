"""The one loop: data of any kind through their plan, block by block, keyed, to be taken up again.

One compiled program serves every block, also the last one, which is filled up with copies of its last scan: only the
scans that there are advance the state. Memory does not grow with the number of scans. Times are exact for as long as a
run lasts (`faintrack.kinds.epochs`). A `Checkpoint` is all that is needed to go on later, in another process too.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float, Int, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.kinds.epochs import epochs, moved_on, since_epochs
from faintrack.kinds.kind import Plan, Step
from faintrack.numerics.programs import Program, kept
from faintrack.numerics.traced import traced

FIRST_KEY = 2**31 - 1
"""Number of the key from which a tracker begins; scans count from 0."""


@dataclass(frozen=True)
class Checkpoint:
    """Where a run stands.

    Attributes
    ----------
    state : after the last scan that was taken in.
    scans : taken in so far.
    epoch : that times in the state are from; seconds.
    """

    state: Any
    scans: int
    epoch: float = 0.0


def run_key(plan_seed: int) -> PRNGKeyArray:
    """Key of a whole run."""
    return jax.random.key(plan_seed)


def _init(tracker: Any, key: PRNGKeyArray) -> Any:
    # With types of their own, as a state that was saved has them: one program serves both.
    return jax.tree.map(lambda leaf: leaf.astype(leaf.dtype), tracker.init(key))


def begun(tracker: Any, seed: int) -> Any:
    """State of a tracker before the first scan.

    Compiled as one program: by itself, each of its operations would be one, some twenty milliseconds each.

    Parameters
    ----------
    tracker : with `init(key)`.
    seed : of the run.
    """
    key = jax.random.fold_in(run_key(seed), FIRST_KEY)
    return kept(_init, tracker, key)(tracker, key)


def advance(
    plan: Plan, since: Checkpoint | None = None, size: int | None = None
) -> Iterator[tuple[Checkpoint, xr.Dataset]]:
    """Yield what is known of consecutive scans, a block at a time, and where the run stands after them.

    Parameters
    ----------
    plan : of the data.
    since : where to go on; from the first scan where not given.
    size : scans taken in at once, instead of the plan's.

    Raises
    ------
    InputError : the data cannot be read, or a belief is lost to a value that is no number.
    """
    size = plan.size if size is None else size
    key = run_key(plan.seed)
    since = Checkpoint(plan.state, 0) if since is None else since
    state, start, epoch = since.state, since.scans, since.epoch
    program: Program | None = None
    while plan.length is None or start < plan.length:
        stop = start + size if plan.length is None else min(start + size, plan.length)
        block = plan.read(start, stop)
        used = _length(block)
        if used == 0:
            return
        of_scans = epochs(block, epoch)
        later = np.diff(of_scans, prepend=epoch).astype(np.float32)
        scans = _filled((since_epochs(block, of_scans, state), later), size)
        arguments = (plan.step, state, *scans, jnp.asarray(used), key)
        program = kept(_take_in, *arguments) if program is None else program
        state, outputs = program(*arguments)
        outputs = jax.tree.map(lambda values, used=used: np.asarray(values)[:used], outputs)
        rows = plan.rows(start, block, outputs)
        _require_numbers(rows, start)
        start, epoch = start + used, float(of_scans[-1])
        yield Checkpoint(state, start, epoch), rows
        if used < stop - (start - used):
            return


def datasets(plan: Plan, since: Checkpoint | None = None) -> Iterator[xr.Dataset]:
    """Yield the blocks of a result, what is known at the end after the others."""
    last = since
    for checkpoint, rows in advance(plan, since):
        last = checkpoint
        yield rows
    if plan.close is not None and last is not None:
        yield plan.close(last.state)


def save_checkpoint(path: str | Path, checkpoint: Checkpoint) -> None:
    """Write where a run stands; `load_checkpoint` reads it for a plan of the same data and scenario."""
    with Path(path).open("wb") as file:
        eqx.tree_serialise_leaves(file, (checkpoint.state, *_counts(checkpoint)))


def load_checkpoint(path: str | Path, plan: Plan) -> Checkpoint:
    """Where a run stood.

    Parameters
    ----------
    path : that `save_checkpoint` wrote.
    plan : of the same data and scenario.

    Raises
    ------
    InputError : the file is missing or damaged, or was written for another scenario.
    """
    try:
        with Path(path).open("rb") as file:
            state, scans, epoch = eqx.tree_deserialise_leaves(file, (plan.state, *_counts(Checkpoint(plan.state, 0))))
    except (OSError, RuntimeError, ValueError, EOFError) as error:
        raise InputError(f"{path} is no state of a run with this scenario ({type(error).__name__}).") from error
    return Checkpoint(state, int(scans), float(epoch))


def _counts(checkpoint: Checkpoint) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(checkpoint.scans, np.int64), np.asarray(checkpoint.epoch, np.float64)


def _take_in(
    step: Step, state: Any, block: Any, later: Float[Array, " scan"], used: Int[Array, ""], key: PRNGKeyArray
) -> tuple[Any, Any]:
    """State after the scans in use of a block, and the outputs of all of them, stacked.

    `later` is by how much the epoch of a scan is later than that of the scan before; seconds.
    """
    scans = step.scans(block)
    size = jax.tree.leaves(scans)[0].shape[0]

    def one(number: Any, state: Any) -> tuple[Any, Any]:
        return step.advance(moved_on(state, later[number]), jax.tree.map(lambda leaf: leaf[number], scans), key)

    step_once, (_, shapes) = traced(one, jnp.asarray(0), state)

    def body(number: Any, carried: tuple[Any, Any]) -> tuple[Any, Any]:
        state, outputs = carried
        state, output = step_once(number, state)
        return state, jax.tree.map(lambda held, value: held.at[number].set(value), outputs, output)

    outputs = jax.tree.map(lambda leaf: jnp.zeros((size, *leaf.shape), leaf.dtype), shapes)
    return jax.lax.fori_loop(0, used, body, (state, outputs))


def _length(block: Any) -> int:
    return len(jax.tree.leaves(block)[0])


def _filled(block: Any, size: int) -> Any:
    """A block whose arrays are filled up to `size` entries with copies of their last."""

    def fill(values: Any) -> Any:
        values = np.asarray(values)
        missing = size - len(values)
        return jnp.asarray(np.concatenate([values, np.repeat(values[-1:], missing, axis=0)]) if missing else values)

    return jax.tree.map(fill, block)


def _require_numbers(rows: xr.Dataset, start: int) -> None:
    """Stop where existence is no number: a belief that holds one never recovers."""
    good = np.isfinite(rows.existence.values).all(axis=1)
    if not good.all():
        raise InputError(
            f"scan {start + int(np.argmin(good))} made the belief no number; please report this with the scenario."
        )
