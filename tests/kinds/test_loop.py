"""The one loop: blocks of any size say the same, a run that is taken up again gives the same bits."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import faintrack as ft
from faintrack.kinds.loop import Checkpoint, advance, load_checkpoint, save_checkpoint
from faintrack.results.schema import joined
from tests.kinds.small import EVERY, SCANS, SCENARIOS, data, plan, result

SMALL = pytest.mark.parametrize("kind", EVERY)
BLOCK = 5


@SMALL
def test_a_run_taken_up_again_gives_the_same_bits(kind: str, tmp_path: Path) -> None:
    """The second half is of another plan, as in another process."""
    whole = joined([rows for _, rows in advance(plan(kind), size=BLOCK)])
    checkpoint, first = next(advance(plan(kind), size=BLOCK))
    assert checkpoint.scans == BLOCK
    save_checkpoint(tmp_path / "state", checkpoint)
    later = plan(kind)
    rest = [rows for _, rows in advance(later, load_checkpoint(tmp_path / "state", later), size=BLOCK)]
    xr.testing.assert_equal(joined([first, *rest]), whole)


@SMALL
def test_following_goes_on_where_it_stopped(kind: str) -> None:
    whole = [moment.data for moment in ft.follow(data(kind), SCENARIOS[kind], block=BLOCK)]
    *_, last = (
        moment for moment, _ in zip(ft.follow(data(kind), SCENARIOS[kind], block=BLOCK), range(2), strict=False)
    )
    assert last.checkpoint.scans == 2 * BLOCK
    (rest,) = ft.follow(data(kind), SCENARIOS[kind], since=last.checkpoint, block=BLOCK)
    xr.testing.assert_equal(rest.data, whole[-1])
    assert list(ft.follow(data(kind), SCENARIOS[kind], since=rest.checkpoint, block=BLOCK)) == []


@SMALL
@pytest.mark.parametrize("size", [BLOCK, pytest.param(1, marks=pytest.mark.slow)])
def test_blocks_of_any_size_say_the_same(kind: str, size: int) -> None:
    """Blocks of 5 leave a last one of 2. Sums are rounded in another order: a thousand roundings of single precision,
    of existence and of components of some hundred units."""
    pieces = list(advance(plan(kind), size=size))
    sizes = [rows.sizes["time"] for _, rows in pieces]
    assert sizes == [size] * (SCANS // size) + [SCANS % size] * (SCANS % size > 0)
    assert [checkpoint.scans for checkpoint, _ in pieces] == np.cumsum(sizes).tolist()
    rows, whole = joined([rows for _, rows in pieces]), result(kind).data
    np.testing.assert_allclose(rows.existence, whole.existence, atol=1e-3)
    for name in rows.component.values:
        np.testing.assert_allclose(rows[name], whole[name], rtol=1e-3, atol=1e-2)


@SMALL
def test_a_state_of_another_scenario_is_refused(kind: str, tmp_path: Path) -> None:
    other = {
        "recording": {"filter": {"particles": 70}},
        "frames": {"filter": {"speeds": 5}},
        "returns": {"grid": SCENARIOS[kind].get("grid", {}) | {"speeds": 5}},
        "bearings": {"filter": {"particles": 400}},
        "records": {"several": {"slots": 3}},
    }[kind]
    first = plan(kind)
    save_checkpoint(tmp_path / "state", Checkpoint(first.state, 3))
    assert load_checkpoint(tmp_path / "state", first).scans == 3
    for path in (tmp_path / "state", tmp_path / "none"):
        with pytest.raises(ft.InputError, match=rf"{path.name} is no state of a run with this scenario"):
            load_checkpoint(path, plan(kind, **other))
    (tmp_path / "state").write_bytes((tmp_path / "state").read_bytes()[:200])
    with pytest.raises(ft.InputError, match="is no state of a run"):
        load_checkpoint(tmp_path / "state", first)


def test_a_belief_that_is_no_number_stops_the_run() -> None:
    good = plan("frames")

    def rows(start: int, block: Any, outputs: Any) -> xr.Dataset:
        """Existence is no number in scan 6."""
        dataset = good.rows(start, block, outputs)
        lost = np.arange(start, start + dataset.sizes["time"]) == 6
        return dataset.assign(existence=dataset.existence.where(~lost[:, None]))

    seen = []
    with pytest.raises(
        ft.InputError, match=r"^scan 6 made the belief no number; please report this with the scen.*\.$"
    ):
        seen += [rows.sizes["time"] for _, rows in advance(dataclasses.replace(good, rows=rows), size=BLOCK)]
    assert seen == []


def test_a_channel_that_fell_silent_before_a_stop_does_not_stop_what_follows() -> None:
    """Whole or in parts: a channel is refused that never held a number, not one that held some earlier."""
    heard = data("recording")
    samples = np.array(heard.read(0, heard.length))
    samples[600:, 1] = np.nan
    holed = ft.from_samples(samples, heard.sample_rate)
    moments = list(ft.follow(holed, SCENARIOS["recording"], block=BLOCK))
    (*_, last) = ft.follow(holed, SCENARIOS["recording"], since=moments[1].checkpoint, block=BLOCK)
    xr.testing.assert_equal(last.data, moments[-1].data)


@SMALL
def test_progress_counts_the_scans(kind: str) -> None:
    steps: list[tuple[int, int | None]] = []
    ft.track(data(kind), SCENARIOS[kind], progress=lambda scans, total: steps.append((scans, total)))
    assert sum(scans for scans, _ in steps) == SCANS
    assert {total for _, total in steps} == {SCANS}
