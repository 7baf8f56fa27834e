"""What belongs to an archive, where it lies on a station's clock, and how that is cut."""

import os
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyarrow")

from faintrack.archive.cut import EMPTY, Cut, Segment, chains_of
from faintrack.archive.pieces import SECOND, Piece, laid, pieces_of
from faintrack.archive.plan import planned
from faintrack.archive.samples import Samples
from faintrack.archive.sources import ALONE, sources_of
from faintrack.errors import InputError
from faintrack.io.write_recordings import write_recording
from tests.archive.small import SCENARIO

NEW_YEAR = np.datetime64("2026-01-01", "ns")


def write(file: Path, seconds: int = 2, channels: int = 2, rate: float = 100.0) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    samples = np.random.default_rng(len(file.name)).normal(size=(round(seconds * rate), channels))
    write_recording(file, [samples.astype(np.float32)], rate)
    return file


def piece(begin: float, seconds: float, rate: float = 10.0, channels: int = 1, station: str = "north") -> Piece:
    names = tuple(map(str, range(channels)))
    start = int(NEW_YEAR.astype(int)) + round(begin * SECOND)
    return Piece((f"{begin:g}.wav",), ("9 9",), station, start, 0, round(seconds * rate), rate, names)


def scans(segment: Segment) -> list[int]:
    """Scans of a segment as whole seconds since the new year, for scans of a second."""
    first = (segment.origin - int(NEW_YEAR.astype(int))) // SECOND
    return [first + scan for low, high in segment.ranges for scan in range(low, high)]


def test_folders_patterns_and_lists_tell_the_same(tmp_path: Path) -> None:
    names = ("north/20260101_000000.wav", "north/20260101_000002.wav", "south/20260101_000000.wav")
    files = [write(tmp_path / name) for name in names]
    (tmp_path / "north" / "notes.txt").touch()
    (tmp_path / "list.csv").write_text(
        "path,station,start\n"
        "north/20260101_000000.wav,north,2026-01-01T00:00:00Z\n"
        "north/20260101_000002.wav,north,2026-01-01T00:00:02Z\n"
        "south/20260101_000000.wav,south,2026-01-01T00:00:00Z\n"
    )
    form = "{station}/%Y%m%d_%H%M%S"
    by_folder, left_out = sources_of([tmp_path], form)
    assert not left_out
    assert [source.paths for source in by_folder] == [(str(file),) for file in files]
    assert sources_of([tmp_path / "*" / "*.wav"], form)[0] == by_folder
    assert sources_of([tmp_path / "list.csv"])[0] == by_folder
    assert sources_of([f"file://{tmp_path}"], form)[0][0].start == NEW_YEAR


def test_files_that_begin_together_are_channels_of_one_recording(tmp_path: Path) -> None:
    one, other = (write(tmp_path / f"{name}_20260101.wav") for name in "ab")
    (source,), _ = sources_of([tmp_path], "%Y%m%d")
    assert source.paths == (str(one), str(other))
    assert source.station == ALONE
    (found,), _ = pieces_of([source], {}, {})
    assert len(found.channel_names) == 4


def test_names_that_do_not_fit_are_told(tmp_path: Path) -> None:
    write(tmp_path / "20260101.wav")
    bad = write(tmp_path / "notes.wav")
    sources, left_out = sources_of([tmp_path], "%Y%m%d")
    assert len(sources) == 1
    assert left_out == [(str(bad), "the name does not fit the pattern '%Y%m%d'")]
    for given, pattern, why in (
        ([tmp_path / "none"], None, "does not exist"),
        ([tmp_path], "%Q", "pattern"),
        ([tmp_path], "{station}/{station}", "two stations"),
    ):
        with pytest.raises(InputError, match=why):
            sources_of(given, pattern)


def test_object_stores_by_their_addresses() -> None:
    """Of a header the first bytes are fetched; the samples are those that were written."""
    import fsspec

    samples = np.random.default_rng(0).integers(-1000, 1000, (200_000, 4)).astype("<i2")
    header = b"RIFF" + (36 + samples.nbytes).to_bytes(4, "little") + b"WAVEfmt " + (16).to_bytes(4, "little")
    header += b"".join(
        n.to_bytes(size, "little") for n, size in ((1, 2), (4, 2), (1000, 4), (8000, 4), (8, 2), (16, 2))
    )
    with fsspec.open("memory://archive/north/20260101_000000.wav", "wb") as file:
        file.write(header + b"data" + samples.nbytes.to_bytes(4, "little") + samples.tobytes())
    sources, _ = sources_of(["memory://archive"], "{station}/%Y%m%d_%H%M%S")
    (found,), left_out = pieces_of(sources, {}, {})
    assert not left_out
    assert (found.station, found.length, found.size) == ("north", 200_000, 44 + samples.nbytes)
    ((segment,),) = chains_of([found], Cut(), 1.0)
    with Samples(segment) as held:
        np.testing.assert_allclose(held.recording().read(1000, 3000), samples[1000:3000] / 2**15)


def test_clocks_that_drift_leave_no_gap_and_overlaps_are_read_once() -> None:
    """Names tell whole seconds; the files are a little shorter than the time between them, then longer."""
    on_clock, left_out = laid([piece(60 * k, 59.9) for k in range(8)])
    assert not left_out
    assert [one.begin for one in on_clock[1:]] == [one.end for one in on_clock[:-1]]
    (first, second), _ = laid([piece(0, 60), piece(50, 60)])
    assert (second.skip, second.begin, second.overlap) == (100, first.end, 100)
    kept, (refused,) = laid([piece(0, 60), piece(60, 60, channels=2), piece(120, 60)])
    assert len(kept) == 2
    assert refused[2].startswith("it has 2 channels at 10 Hz")


def test_every_scan_is_in_one_segment_and_gaps_are_passed_over() -> None:
    """Whatever the cut: of the same chain the same scans, and of long gaps none."""
    pieces, _ = laid([piece(3, 100), piece(103 + EMPTY - 1, 50), piece(400, 200), piece(7000, 30)])
    expected = None
    for segment in (20, 60, 200, 600):
        chains = chains_of(pieces, Cut(segment, 600, 50), 1.0)
        mine = [scan for chain in chains for one in chain for scan in scans(one)]
        expected = mine if expected is None else expected
        assert mine == expected
        assert [one.before for chain in chains for one in chain[:1]] == [None] * len(chains)
    assert expected is not None
    # The chain of the second ten minutes has nothing of its own, and so no burn-in.
    assert expected == [*range(3, 103 + EMPTY + 49), *range(400, 600), *range(7000, 7030)]


def test_a_chain_begins_with_a_burn_in() -> None:
    first, second = chains_of(laid([piece(100, 900)])[0], Cut(300, 600, 50), 1.0)
    assert scans(first[0]) == list(range(100, 300))
    assert scans(second[0]) == list(range(550, 900))
    assert scans(second[1]) == list(range(900, 1000))


def test_a_fingerprint_is_of_all_that_a_result_depends_on() -> None:
    def made(pieces: list[Piece]) -> list[str]:
        return [one.fingerprint for chain in chains_of(laid(pieces)[0], Cut(60, 600, 50), 1.0) for one in chain]

    pieces = [piece(60 * k, 60) for k in range(5)]
    before = made(pieces)
    assert made(pieces[:4])[:3] == before[:3]
    import dataclasses

    changed = [dataclasses.replace(one, stamps=("9 10",)) if k == 3 else one for k, one in enumerate(pieces)]
    after = made(changed)
    # The second before a seam reads a little beyond it, and what follows begins with another state.
    assert [one == other for one, other in zip(before, after, strict=True)] == [True, True, False, False, False]
    moved = [dataclasses.replace(one, paths=(os.path.join("other", one.paths[0]),)) for one in pieces]
    assert made(moved) == before


def test_a_plan_tells_what_is_there(tmp_path: Path) -> None:
    write(tmp_path / "20260101_000000.wav", 60, channels=4)
    write(tmp_path / "20260101_000100.wav", 60, channels=4)
    write(tmp_path / "20260101_000400.wav", 60, channels=4)
    write(tmp_path / "20260101_000430.wav", 60, channels=4)
    odd = write(tmp_path / "20260101_001000.wav", 60, channels=3)
    plan = planned([tmp_path], SCENARIO, Cut(60, 600, 60), "%Y%m%d_%H%M%S")
    (facts,) = plan.stations
    assert (facts.gaps, facts.overlaps, facts.overlap_s, facts.channels) == (1, 1, 30.0, 4)
    assert facts.hours == pytest.approx(210 / 3600)
    assert facts.gap_hours == pytest.approx(120 / 3600)
    assert [path for path, _, _ in plan.left_out] == [str(odd)]
    with pytest.raises(InputError, match="of frames"):
        planned([tmp_path], {"kind": "frames"}, None, "%Y%m%d_%H%M%S")


@pytest.mark.parametrize("wrong", [{"segment": 7.0}, {"burn_in": 1e6}, {"segment": 0.0}])
def test_cuts_that_do_not_fit(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match="burn-in"):
        Cut(**wrong)
