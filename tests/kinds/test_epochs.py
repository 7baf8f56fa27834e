"""Times stay exact however long a run lasts: what is compiled has them from an epoch that moves along."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pytest
import xarray as xr

from faintrack.kinds import epochs
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import Checkpoint, advance, load_checkpoint, save_checkpoint
from faintrack.results.schema import joined
from tests.kinds.small import EVERY, plan

BLOCK = 5
LATE = 97_656 * epochs.SPAN
"""Three years; single precision resolves 8 s there."""


def run(some: Plan, since: Checkpoint | None = None) -> xr.Dataset:
    return joined([rows for _, rows in advance(some, since, BLOCK)])


def later(some: Plan, seconds: float) -> Plan:
    """A plan whose scans come so much later on its own clock."""

    def read(start: int, stop: int) -> Any:
        return jax.tree_util.tree_map_with_path(
            lambda path, leaf: np.asarray(leaf, float) + seconds if getattr(path[-1], "name", "") == "time" else leaf,
            some.read(start, stop),
        )

    return replace(some, read=read)


@pytest.mark.parametrize("kind", EVERY)
def test_a_run_three_years_on_has_the_same_bits(kind: str) -> None:
    first = plan(kind)
    whole = run(first)
    second = plan(kind)
    late = run(later(second, LATE), Checkpoint(second.state, 0, LATE))
    for name in whole.data_vars:
        np.testing.assert_array_equal(late[name].values, whole[name].values, err_msg=str(name))


@pytest.mark.parametrize("kind", [param for param in EVERY if param.values[0] != "returns"])
def test_where_an_epoch_begins_changes_nothing(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Epochs of half a second: every time that a state remembers moves with them, or intervals would be wrong.

    A thousand roundings of single precision, as for blocks of other sizes. Of returns the points at which a mean over a
    cell is taken are drawn by the time since the epoch, and are others.
    """
    whole = run(plan(kind))
    monkeypatch.setattr(epochs, "SPAN", 0.5)
    other = run(plan(kind))
    np.testing.assert_allclose(other.existence, whole.existence, atol=1e-3)
    np.testing.assert_array_equal(other.label, whole.label)
    for name in whole.component.values:
        np.testing.assert_allclose(other[name], whole[name], rtol=1e-3, atol=1e-2)


@pytest.mark.parametrize("kind", EVERY)
def test_every_kind_tells_times_by_their_names(kind: str) -> None:
    some = plan(kind)
    block = some.read(0, 3)
    assert epochs.epochs(later(some, LATE).read(0, 3), 0.0).min() >= LATE, "a block holds a field named time"
    moved = epochs.since_epochs(block, np.full(3, -LATE), some.state)
    assert sum(not np.array_equal(a, b) for a, b in zip(jax.tree.leaves(moved), jax.tree.leaves(block), strict=True))


def test_a_state_and_its_epoch_are_saved_together(tmp_path: Any) -> None:
    some = plan("frames")
    save_checkpoint(tmp_path / "state", Checkpoint(some.state, 7, LATE))
    assert load_checkpoint(tmp_path / "state", some).epoch == LATE
