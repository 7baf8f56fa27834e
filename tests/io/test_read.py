"""What is read is what was written, whole or in blocks, and memory does not grow with the file."""

import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faintrack.data.recording import Recording
from faintrack.io import read, write_recording

DATA = Path(__file__).parents[2].parent / "shared/data"
START = np.datetime64("2024-05-01T12:00:00", "ns")


@pytest.fixture
def samples() -> np.ndarray:
    """Small whole numbers, which every format keeps exactly; shape (1000, 3)."""
    return np.random.default_rng(1).integers(-1000, 1000, (1000, 3)).astype(np.float32)


def need(folder: str) -> Path:
    if not (DATA / folder).is_dir():
        pytest.skip(f"../shared/data/{folder} is absent")
    return DATA / folder


def write_flac(path: Path, samples: np.ndarray) -> None:
    soundfile = pytest.importorskip("soundfile")
    soundfile.write(path, samples / 2**15, 100, subtype="PCM_16")


def traces(samples: np.ndarray, start_times: list[np.datetime64], stations: list[str], channels: list[str]):
    obspy = pytest.importorskip("obspy")
    codes = zip(samples.T, start_times, stations, channels, strict=True)
    return obspy.Stream(
        obspy.Trace(
            np.ascontiguousarray(column),
            {
                "sampling_rate": 100.0,
                "starttime": obspy.UTCDateTime(str(start)),
                "station": station,
                "channel": channel,
                "network": "XX",
            },
        )
        for column, start, station, channel in codes
    )


def write_seismic(path: Path, samples: np.ndarray, start=START, stations="ABC", **options) -> None:
    """One file of channels named after stations; SAC takes one channel only."""
    count = samples.shape[1]
    stream = traces(samples, [start] * count, list(stations)[:count], ["BDF"] * count)
    stream.write(str(path), format="SAC" if path.suffix.lower() == ".sac" else "MSEED", **options)


def whole(recording: Recording) -> np.ndarray:
    return recording.read(0, recording.length)


@pytest.mark.parametrize("name", ["rec.wav", "rec.h5", "rec.hdf5", "rec.zarr", "REC.WAV"])
def test_what_is_written_is_read(tmp_path, samples, name):
    write_recording(tmp_path / name, [samples[:300], samples[300:]], 100.0)
    recording = read(tmp_path / name)
    np.testing.assert_array_equal(whole(recording), samples)
    assert whole(recording).dtype == np.float32
    assert (recording.length, recording.sample_rate, recording.channel_names) == (1000, 100.0, ("0", "1", "2"))
    assert recording.start_time is None
    assert recording.source.endswith(name)


@pytest.mark.parametrize("name", ["rec.h5", "rec.zarr"])
def test_names_and_start_time_are_kept(tmp_path, samples, name):
    start = START + np.timedelta64(123456789, "ns")
    write_recording(tmp_path / name, [samples], 51200.5, ("a", "b", "ü"), start)
    recording = read(str(tmp_path / name))
    assert (recording.sample_rate, recording.channel_names, recording.start_time) == (51200.5, ("a", "b", "ü"), start)


def test_flac_is_scaled_to_one(tmp_path, samples):
    write_flac(tmp_path / "rec.flac", samples)
    np.testing.assert_array_equal(whole(read(tmp_path / "rec.flac")), samples / 2**15)


def test_double_precision_stays(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "rec.h5", "w") as file:
        file["time_data"] = np.full((5, 1), np.pi)
        file["time_data"].attrs["sample_freq"] = [100.0]
    assert whole(read(tmp_path / "rec.h5"))[0, 0] == np.pi


@pytest.mark.parametrize("byteorder", ["<", ">"])
def test_sac_of_either_byte_order(tmp_path, samples, byteorder):
    write_seismic(tmp_path / "a.sac", samples[:, :1], byteorder=byteorder)
    recording = read(tmp_path / "a.sac")
    np.testing.assert_array_equal(whole(recording), samples[:, :1])
    assert (recording.channel_names, recording.start_time) == (("A",), START)


def test_miniseed_channels_and_gaps(tmp_path, samples):
    stream = traces(samples, [START] * 3, ["A", "B", "C"], ["BDF"] * 3)
    gapped = stream.pop(1)
    start = gapped.stats.starttime
    stream.extend([gapped.slice(endtime=start + 3.99), gapped.slice(starttime=start + 6.0)])
    stream.sort().write(str(tmp_path / "a.mseed"), format="MSEED", reclen=512)
    recording = read(tmp_path / "a.mseed")
    samples[400:600, 1] = np.nan
    np.testing.assert_array_equal(whole(recording), samples)
    assert (recording.channel_names, recording.start_time) == (("A", "B", "C"), START)


def test_miniseed_channels_are_missing_before_they_start_and_after_they_end(tmp_path, samples):
    starts = [START, START + np.timedelta64(1, "s"), START - np.timedelta64(500, "ms")]
    traces(samples, starts, ["A", "B", "C"], ["BDF"] * 3).write(str(tmp_path / "a.mseed"), format="MSEED")
    recording = read(tmp_path / "a.mseed")
    expected = np.full((1150, 3), np.nan)
    for column, late in enumerate((50, 150, 0)):
        expected[late : late + 1000, column] = samples[:, column]
    np.testing.assert_array_equal(whole(recording), expected)
    assert recording.start_time == starts[2]
    assert "Channel XX.B..BDF has no samples in 1.5 s at the beginning; they are missing." in recording.remarks
    assert "Channel XX.C..BDF has no samples in 1.5 s at the end; they are missing." in recording.remarks


@pytest.mark.parametrize("name", ["rec.wav", "rec.flac", "rec.h5", "rec.zarr", "rec.sac", "rec.mseed"])
def test_blocks_make_the_whole(tmp_path, name):
    # Long enough for several pieces of a miniSEED file and several chunks of the others.
    samples = np.random.default_rng(2).integers(-30000, 30000, (150_000, 2)).astype(np.float32)
    if name.endswith((".sac", ".mseed")):
        samples = samples[:, : 1 if name.endswith(".sac") else 2]
        write_seismic(tmp_path / name, samples)
    elif name.endswith(".flac"):
        write_flac(tmp_path / name, samples)
        samples = samples / 2**15
    else:
        write_recording(tmp_path / name, [samples], 100.0)
    recording = read(tmp_path / name)
    np.testing.assert_array_equal(whole(recording), samples)
    np.testing.assert_array_equal(np.concatenate(list(recording.blocks(7001))), samples)


@pytest.mark.parametrize("name", ["rec.wav", "rec.h5", "rec.zarr", "rec.sac", "rec.mseed"])
def test_memory_is_bounded(tmp_path, name):
    channels, length = (1, 2_000_000) if name.endswith((".sac", ".mseed")) else (4, 500_000)
    block = np.random.default_rng(3).integers(-1000, 1000, (10_000, channels)).astype(np.float32)
    if channels == 1:
        write_seismic(tmp_path / name, np.tile(block, (length // 10_000, 1)))
    else:
        write_recording(tmp_path / name, (block for _ in range(length // 10_000)), 100.0)
    read(tmp_path / name).read(0, 10)  # the libraries allocate when they are imported
    tracemalloc.start()
    recording = read(tmp_path / name)
    total = sum(len(block) for block in recording.blocks(20_000))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert total == length
    # The samples take 8 MB; a block with the pieces or chunks that it touches takes about 1 MB.
    assert peak < 2e6


def test_files_with_start_times_stand_on_one_time_axis(tmp_path, samples):
    later = START + np.timedelta64(2004, "ms")  # 0.4 of a sample would be refused, 0.04 is rounding
    write_recording(tmp_path / "a.h5", [samples], 10.0, ("a", "b", "c"), START)
    write_recording(tmp_path / "b.zarr", [samples], 10.0, ("d", "e", "f"), later)
    recording = read(tmp_path / "a.h5", tmp_path / "b.zarr")
    expected = np.full((1020, 6), np.nan)
    expected[:1000, :3], expected[20:, 3:] = samples, samples
    np.testing.assert_array_equal(whole(recording), expected)
    for start, stop in ((5, 7), (10, 30), (990, 1020), (19, 20), (1000, 1001)):
        np.testing.assert_array_equal(recording.read(start, stop), expected[start:stop])
    assert (recording.channel_names, recording.start_time) == (tuple("abcdef"), START)
    assert [remark.split(" has ")[1] for remark in recording.remarks] == [
        "no samples in 2 s at the end; they are missing.",
        "no samples in 2 s at the beginning; they are missing.",
    ]
    assert recording.source.endswith("a.h5 and 1 more")


def test_channels_of_nameless_files_are_numbered_on(tmp_path, samples):
    for name, factor in (("a.wav", 1), ("b.wav", 2)):
        write_recording(tmp_path / name, [samples * factor], 100.0)
    recording = read(tmp_path / "a.wav", tmp_path / "b.wav")
    np.testing.assert_array_equal(whole(recording), np.hstack([samples, samples * 2]))
    assert recording.channel_names == tuple("012345")
    assert recording.remarks == ()


def test_station_names_grow_only_where_they_repeat(tmp_path, samples):
    traces(samples, [START] * 3, ["A", "A", "B"], ["BHE", "BHN", "BHE"]).write(
        str(tmp_path / "a.mseed"), format="MSEED"
    )
    assert read(tmp_path / "a.mseed").channel_names == ("A.BHE", "A.BHN", "B.BHE")


def test_four_infrasound_stations():
    obspy = pytest.importorskip("obspy")
    files = sorted(need("infrasound_array").glob("*.SAC"))
    recording = read(*files)
    expected = np.column_stack([obspy.read(str(file))[0].data for file in files])
    np.testing.assert_array_equal(whole(recording), expected)
    assert recording.channel_names == ("BRP1", "BRP2", "BRP3", "BRP4")
    assert (recording.sample_rate, recording.duration) == (100.0, 1200.0)
    assert str(recording.start_time).startswith("2012-04-09T18:00:00.0083")


def test_acoular_file():
    h5py = pytest.importorskip("h5py")
    path = need("acoular_airfoil_56ch") / "example_data.h5"
    recording = read(path)
    with h5py.File(path) as file:
        np.testing.assert_array_equal(recording.read(100, 300), file["time_data"][100:300])
    assert (recording.length, recording.channels, recording.sample_rate) == (25600, 56, 51200.0)


def test_reading_needs_obspy_only_for_seismic_files(tmp_path, samples, monkeypatch):
    write_seismic(tmp_path / "a.sac", samples[:, :1])
    write_recording(tmp_path / "a.wav", [samples], 100.0)
    for module in [name for name in sys.modules if name.split(".")[0] == "obspy"]:
        monkeypatch.setitem(sys.modules, module, None)
    assert read(tmp_path / "a.wav").channels == 3
    with pytest.raises(ValueError, match=r'a\.sac needs ObsPy.*pip install "faintrack\[seismic\]"'):
        read(tmp_path / "a.sac")


def test_a_recording_stays_a_value(tmp_path, samples):
    write_recording(tmp_path / "a.wav", [samples], 100.0)
    assert replace(read(tmp_path / "a.wav"), channel_names=("x", "y", "z")).channel_names == ("x", "y", "z")
