"""A file appears complete or not at all."""

import os
from pathlib import Path

import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.io import read, write_recording, writers

NAMES = ["rec.h5", "rec.hdf5", "rec.zarr", "rec.wav"]
BLOCK = np.arange(12, dtype=np.float32).reshape(6, 2)


def broken(error: BaseException):
    yield BLOCK
    raise error


@pytest.mark.parametrize("name", NAMES)
def test_any_block_size_gives_the_same_samples(tmp_path, name):
    samples = np.random.default_rng(4).standard_normal((40_000, 3)).astype(np.float32)
    write_recording(tmp_path / name, np.array_split(samples, 37), 100.0)
    np.testing.assert_array_equal(read(tmp_path / name).read(0, 40_000), samples)
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", NAMES)
def test_an_array_that_is_used_again_is_not_mixed_up(tmp_path, name):
    block = np.zeros((6, 2), np.float32)

    def blocks():
        for value in range(3):
            block[:] = value
            yield block

    write_recording(tmp_path / name, blocks(), 100.0)
    assert read(tmp_path / name).read(0, 18)[:, 0].tolist() == [0.0] * 6 + [1.0] * 6 + [2.0] * 6


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError("tape snapped"), InputError("a gap.")])
def test_an_interrupted_file_leaves_no_trace(tmp_path, name, error):
    with pytest.raises(type(error)) as raised:
        write_recording(tmp_path / name, broken(error), 100.0)
    assert raised.value is error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", NAMES)
def test_an_older_file_is_replaced_only_by_a_complete_one(tmp_path, name):
    write_recording(tmp_path / name, [BLOCK], 100.0)
    with pytest.raises(KeyboardInterrupt):
        write_recording(tmp_path / name, broken(KeyboardInterrupt()), 200.0)
    assert read(tmp_path / name).sample_rate == 100.0
    write_recording(tmp_path / name, [BLOCK + 1], 200.0)
    np.testing.assert_array_equal(read(tmp_path / name).read(0, 6), BLOCK + 1)
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", NAMES)
def test_what_a_killed_run_left_is_swept_away(tmp_path, name):
    """It carries our mark."""
    left = tmp_path / f".{name}.x1.partial"
    left.mkdir()
    (left / ".faintrack").touch()
    write_recording(tmp_path / name, [BLOCK], 100.0)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_wav_file_is_plain_until_it_is_too_long(tmp_path, monkeypatch):
    write_recording(tmp_path / "short.wav", [BLOCK], 100.0)
    monkeypatch.setattr(writers, "_WAV_BYTES", 100)
    write_recording(tmp_path / "long.wav", [BLOCK], 100.0)
    for name, kind in (("short.wav", b"RIFF"), ("long.wav", b"RF64")):
        assert (tmp_path / name).read_bytes()[:4] == kind
        np.testing.assert_array_equal(read(tmp_path / name).read(0, 6), BLOCK)


def test_scipy_reads_our_wav_file(tmp_path):
    wavfile = pytest.importorskip("scipy.io.wavfile")
    write_recording(tmp_path / "rec.wav", [BLOCK], 100.0)
    rate, samples = wavfile.read(tmp_path / "rec.wav")
    assert rate == 100
    np.testing.assert_array_equal(samples, BLOCK)


def test_what_is_missing_from_a_zarr_folder_is_a_gap(tmp_path):
    write_recording(tmp_path / "rec.zarr", [np.ones((40_000, 2))], 100.0)
    (tmp_path / "rec.zarr/time_data/c/0/0").unlink()
    samples = read(tmp_path / "rec.zarr").read(0, 40_000)[:, 0]
    assert np.isnan(samples[0])
    assert samples[-1] == 1.0


@pytest.mark.parametrize(
    ("name", "blocks", "rate", "names", "sentence"),
    [
        ("rec.mat", [BLOCK], 100.0, None, "rec.mat: unknown kind of file; expected .h5, .hdf5, .zarr or .wav."),
        ("rec.h5", [BLOCK], 0.0, None, "rec.h5: the sample rate is 0.0, expected a number above 0 Hz."),
        ("rec.wav", [BLOCK], 0.5, None, "rec.wav: the sample rate is 0.5 Hz; WAV keeps whole numbers only."),
        ("rec.h5", [], 100.0, None, "rec.h5: there are no samples to write."),
        ("rec.h5", [BLOCK[:0]], 100.0, None, "rec.h5: there are no samples to write."),
        ("rec.h5", [BLOCK], 100.0, ("a",), "rec.h5: there are 1 channel names for 2 channels."),
        ("rec.h5", [BLOCK[:, 0]], 100.0, None, "rec.h5: a block has shape (6,); expected (time, channel)."),
        ("rec.zarr", [BLOCK, BLOCK.T], 100.0, None, "a block has shape (2, 6); expected (time, 2)."),
        ("rec.wav", [BLOCK * 1j], 100.0, None, "rec.wav: a block holds complex64; expected real numbers."),
        ("no/rec.h5", [BLOCK], 100.0, None, "no is not a folder."),
        ("file/rec.h5", [BLOCK], 100.0, None, "file is not a folder."),
        ("folder.h5", [BLOCK], 100.0, None, "folder.h5 is something else than the kind of file to write"),
        ("folder.zarr", [BLOCK], 100.0, None, "folder.zarr is something else than the kind of file to write"),
        ("file.zarr", [BLOCK], 100.0, None, "file.zarr is something else than the kind of file to write"),
        ("rec.wav", [np.zeros((6, 2000))], 100.0, None, "rec.wav cannot be written ("),
    ],
)
def test_what_cannot_be_written_is_said_in_one_sentence(tmp_path, name, blocks, rate, names, sentence):
    for folder in ("folder.h5", "folder.zarr"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "notes.txt").touch()
    for file in ("file", "file.zarr"):
        (tmp_path / file).touch()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError) as raised:
        write_recording(tmp_path / name, blocks, rate, names)
    assert sentence in str(raised.value)
    assert str(tmp_path / name) in str(raised.value)
    assert "\n" not in str(raised.value)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the superuser may write anywhere")
@pytest.mark.parametrize("name", NAMES)
def test_a_folder_without_permission(tmp_path: Path, name):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match=f"{name} cannot be written"):
            write_recording(tmp_path / name, [BLOCK], 100.0)
    finally:
        tmp_path.chmod(0o700)


@pytest.mark.parametrize("name", NAMES)
def test_a_full_disk(tmp_path, monkeypatch, name):
    def refuse(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(InputError, match=rf"{name} cannot be written \(No space left on device\)\."):
        write_recording(tmp_path / name, [BLOCK], 100.0)
    assert list(tmp_path.iterdir()) == []


def test_what_a_user_has_beside_a_file_stays(tmp_path):
    for name in ("a.h5.partial", "a.h5.older"):
        (tmp_path / name).write_text("mine")
    for _ in range(2):
        write_recording(tmp_path / "a.h5", [np.zeros((9, 2))], 100.0)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.h5", "a.h5.older", "a.h5.partial"]
    os.mkfifo(tmp_path / "a.wav")
    with pytest.raises(InputError, match=r"a.wav is something else than the kind of file to write"):
        write_recording(tmp_path / "a.wav", [np.zeros((9, 2))], 100.0)
