"""A result is whole or not there."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from faintrack.data.recording import from_samples
from faintrack.io import results
from faintrack.io.results import read_result, result_folder, write_result
from faintrack.kinds.session import track, track_blocks
from faintrack.scenario import Scenario
from faintrack.sensors.array import line_array

ARRAY = line_array(4, 1.0)
RECORDING = from_samples(np.random.default_rng(0).normal(size=(6000, 4)), 1000.0)


def test_written_in_pieces_equals_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results, "CHUNK", 4)
    scenario = Scenario()
    monkeypatch.setattr("faintrack.kinds.session.LONGEST_BLOCK", 2)
    with result_folder(tmp_path / "out") as folder:
        write_result(folder, track_blocks(RECORDING, ARRAY, scenario), scenario, ARRAY)
    kept, held = read_result(tmp_path / "out"), track(RECORDING, ARRAY, scenario=scenario)
    xr.testing.assert_equal(kept.data.load(), held.data)
    assert kept.data.record.attrs == held.data.record.attrs
    np.testing.assert_allclose(kept.array.positions, ARRAY.positions)


@pytest.mark.parametrize("reason", [KeyboardInterrupt, RuntimeError, OSError])
def test_an_interruption_leaves_the_earlier_result(tmp_path: Path, reason: type[BaseException]) -> None:
    scenario, out = Scenario(), tmp_path / "out"
    with result_folder(out) as folder:
        write_result(folder, track_blocks(RECORDING, ARRAY, scenario), scenario, ARRAY)
    before = (out / "versions.json").read_text()

    def interrupted() -> Iterator[xr.Dataset]:
        yield from track_blocks(RECORDING, ARRAY, scenario)
        raise reason

    with pytest.raises((reason, ValueError)), result_folder(out) as folder:
        write_result(folder, interrupted(), scenario, ARRAY)
    assert (out / "versions.json").read_text() == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
