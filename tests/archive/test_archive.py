"""Archives: the same tracks however time was cut, the same bits whoever computes them, nothing lost to bad files."""

import json
import os
import shutil
import signal
import struct
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pyarrow")
import pandas as pd

from faintrack.archive import run as running
from faintrack.archive import samples
from faintrack.archive.cut import Cut
from faintrack.archive.report import write_report
from faintrack.archive.run import retry, run
from faintrack.archive.status import Status, status
from faintrack.archive.store import opened, writing
from faintrack.errors import InputError
from faintrack.io.write_recordings import write_recording
from faintrack.studies.running import connect
from tests.archive.small import BEGIN, CUT, FILE, PATTERN, RATE, SECONDS, file_at, make
from tests.cli.calling import call


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("archive") / "recordings")


@pytest.fixture(scope="module")
def whole(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Store of an undisturbed run, in this process alone."""
    store = tmp_path_factory.mktemp("archive") / "store"
    assert track(recordings, store).whole
    return store


@pytest.fixture
def copy(recordings: Path, tmp_path: Path) -> Path:
    """Recordings that a test may spoil."""
    return Path(shutil.copytree(recordings, tmp_path / "copy"))


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with connect(workers=2) as client:
        yield client


def track(recordings: Path, store: Path, cut: Cut = CUT, **options: Any) -> Status:
    options = {"workers": 0, **options}
    return run(recordings / "scenario.toml", [recordings], store, pattern=PATTERN, cut=cut, **options)


def states(store: Path) -> pd.DataFrame:
    """All states by station, track and time; the column `day` and labels within a chain are those of a cut."""
    table = pd.read_parquet(store / "states").drop(columns=["day", "label"])
    return table.sort_values(["station", "track", "utc"], ignore_index=True)


def bits(store: Path) -> dict[str, bytes]:
    """What has to be the same whoever computes it."""
    kept = [*store.glob("segments/*/*/seam.state"), *store.glob("segments/*/*/states.parquet")]
    kept += [*store.glob("states/*/*/*.parquet"), *store.glob("tracks/*/*/*.parquet")]
    assert kept
    return {str(file.relative_to(store)): file.read_bytes() for file in kept}


def test_tracks_are_those_of_the_sources(whole: Path) -> None:
    """Two sources a station; one of them over midnight, where a chain ends."""
    tracks = pd.read_parquet(whole / "tracks")
    for station, crossing in (("north", 60.0), ("south", 100.0)):
        mine = tracks[tracks["station"] == station]
        assert mine["track"].nunique() == 2
        over = mine[mine["track"].str.startswith("20260101T2358")]
        assert over["day"].astype(str).tolist() == ["2026-01-01", "2026-01-02"]
        assert over["track"].nunique() == 1
        np.testing.assert_allclose(over["bearing_deg_start"].iloc[0], crossing, atol=8)
        np.testing.assert_allclose(over["bearing_deg_end"].iloc[1], crossing + 11, atol=8)
        # It is in hand until the end; the other one is given up soon after it has stopped.
        last = pd.Timestamp(BEGIN, tz="UTC") + pd.Timedelta(seconds=SECONDS - 0.25)
        assert over["end"].max() == last
        assert mine["end"].min() < pd.Timestamp(BEGIN, tz="UTC") + pd.Timedelta(seconds=170 + 15)


@pytest.mark.parametrize("segment", [10, 15, 24, 40, 120])
def test_segments_of_any_length_give_the_same_bits(
    recordings: Path, whole: Path, tmp_path: Path, segment: float
) -> None:
    store = tmp_path / "store"
    track(recordings, store, Cut(segment, CUT.chain, CUT.burn_in))
    pd.testing.assert_frame_equal(states(store), states(whole), check_exact=True)


@pytest.mark.parametrize("chain", [60, 240, 480])
def test_chains_of_any_length_give_the_same_tracks(
    recordings: Path, whole: Path, tmp_path: Path, chain: float
) -> None:
    """After joining: the same names; where a state differs, within what the sensor tells apart."""
    store = tmp_path / "store"
    track(recordings, store, Cut(30, chain, 30))
    one, other = states(whole), states(store)
    assert set(one["track"]) == set(other["track"])
    both = one.merge(other, on=["station", "track", "utc"])
    # A track that fades may end a few scans apart.
    assert len(both) >= 0.97 * max(len(one), len(other))
    apart = (both["bearing_deg_x"] - both["bearing_deg_y"]).abs()
    assert float(apart.max()) < json.loads(next(store.glob("segments/*/*/segment.json")).read_text())["within"]
