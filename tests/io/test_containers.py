"""Whatever the header of an audio file says of its length: all samples are read, or both numbers are said."""

import struct
from pathlib import Path

import numpy as np
import pytest
import soundfile

from faintrack.errors import InputError
from faintrack.io import read

SAMPLES = np.random.default_rng(4).integers(-(2**15), 2**15, (600, 3)) / 2**15
KINDS = {
    ("wav", "WAV"): ("PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE", "ULAW"),
    ("wav", "WAVEX"): ("PCM_16", "PCM_24", "FLOAT"),
    ("wav", "RF64"): ("PCM_16", "PCM_24", "FLOAT"),
    ("w64", "W64"): ("PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE", "ALAW"),
    ("aif", "AIFF"): ("PCM_S8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE", "ULAW"),
    ("caf", "CAF"): ("PCM_S8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE", "ALAW"),
    ("flac", "FLAC"): ("PCM_S8", "PCM_16", "PCM_24"),
}
CASES = [(suffix, form, kind) for (suffix, form), kinds in KINDS.items() for kind in kinds]


def written(path: Path, kind: str = "PCM_16", form: str | None = None, endian: str | None = None) -> bytearray:
    soundfile.write(path, SAMPLES, 2000, subtype=kind, format=form, endian=endian)
    return bytearray(path.read_bytes())


def whole(path: Path) -> np.ndarray:
    recording = read(path)
    return recording.read(0, recording.length)


@pytest.mark.parametrize(("suffix", "form", "kind"), CASES)
def test_the_same_as_libsndfile(tmp_path, suffix, form, kind):
    path = tmp_path / f"a.{suffix}"
    written(path, kind, form)
    recording = read(path)
    expected, rate = soundfile.read(path, dtype="float64" if kind == "DOUBLE" else "float32")
    np.testing.assert_array_equal(recording.read(0, recording.length), expected)
    np.testing.assert_array_equal(recording.read(123, 457), expected[123:457])
    assert (recording.sample_rate, recording.remarks) == (rate, ())


@pytest.mark.parametrize("kind", ["PCM_16", "PCM_24", "FLOAT"])
@pytest.mark.parametrize(
    ("suffix", "form", "endian"), [("wav", "WAV", "BIG"), ("aif", "AIFF", "LITTLE"), ("caf", "CAF", "LITTLE")]
)
def test_the_other_byte_order(tmp_path, suffix, form, endian, kind):
    path = tmp_path / f"a.{suffix}"
    try:
        written(path, kind, form, endian)
    except ValueError:
        pytest.skip("not a form of this container")
    np.testing.assert_array_equal(whole(path), soundfile.read(path, dtype="float32")[0])


def with_size(path: Path, name: bytes, size: bytes, content: bytearray) -> None:
    at = content.index(name) + len(name)
    content[at : at + len(size)] = size
    path.write_bytes(content)


@pytest.mark.parametrize("told", [0, 600, 601, 0x7FFFF000, 0x80000000, 0xFFFFFFFF - 36, 0xFFFFFFFF])
@pytest.mark.parametrize(("form", "order"), [("WAV", "<"), ("RIFX", ">")])
def test_wav_whose_size_field_does_not_tell(tmp_path, told, form, order):
    path = tmp_path / "a.wav"
    content = written(path, endian="BIG" if form == "RIFX" else None)
    with_size(path, b"data", struct.pack(f"{order}I", told), content)
    recording = read(path)
    np.testing.assert_array_equal(recording.read(0, recording.length), SAMPLES.astype(np.float32))
    (remark,) = recording.remarks
    assert "3600" in remark


def test_chunks_after_the_samples_are_no_samples(tmp_path):
    path = tmp_path / "a.wav"
    content = written(path)
    path.write_bytes(content + b"LIST" + struct.pack("<I", 6) + b"INFOab" + b"abcd" + struct.pack("<I", 3) + b"xyz\0")
    recording = read(path)
    assert (recording.length, recording.remarks) == (600, ())


def test_wav_of_which_more_is_promised_than_there_is(tmp_path):
    path = tmp_path / "a.wav"
    path.write_bytes(written(path)[:-100])
    with pytest.raises(InputError, match="holds 3500 of the 3600 bytes of samples that its header promises"):
        read(path)


@pytest.mark.parametrize("many", [1, 2])
def test_wav_whose_size_has_wrapped(tmp_path, many):
    """Sparse: 4 or 8 GiB that take no room on the disk."""
    path = tmp_path / "a.wav"
    content = written(path)
    at = content.index(b"data") + 8
    size = (many * 2**32 // 6 + 1000) * 6
    with path.open("wb") as file:
        file.write(content[: at - 4] + struct.pack("<I", size % 2**32) + content[at:])
        file.truncate(at + size)
    recording = read(path)
    assert recording.length == size // 6
    np.testing.assert_array_equal(recording.read(0, 600), SAMPLES.astype(np.float32))
    assert not recording.read(recording.length - 10, recording.length).any()
    (remark,) = recording.remarks
    assert str(size) in remark


def test_wav_whose_size_has_wrapped_before_other_chunks(tmp_path):
    path = tmp_path / "a.wav"
    content = written(path)
    at = content.index(b"data") + 8
    size = (2**32 // 6 + 1000) * 6
    with path.open("wb") as file:
        file.write(content[: at - 4] + struct.pack("<I", size % 2**32) + content[at:])
        file.seek(at + size)
        file.write(b"LIST" + struct.pack("<I", 4) + b"INFO")
    assert read(path).length == size // 6


def test_rf64_tells_long_sizes(tmp_path):
    path = tmp_path / "a.wav"
    content = written(path, form="RF64")
    assert content[:4] == b"RF64"
    at = content.index(b"ds64") + 16
    for told in (0, 600, 2**64 - 1):
        content[at : at + 8] = struct.pack("<Q", told)
        path.write_bytes(content)
        assert read(path).length == 600
        assert read(path).remarks
    content[at : at + 8] = struct.pack("<Q", 4000)
    path.write_bytes(content)
    with pytest.raises(InputError, match="holds 3600 of the 4000 bytes"):
        read(path)


def test_wave64_of_unknown_length(tmp_path):
    path = tmp_path / "a.w64"
    content = written(path, form="W64")
    with_size(path, b"data\xf3\xac\xd3\x11\x8c\xd1\x00\xc0\x4f\x8e\xdb\x8a", struct.pack("<Q", 24), content)
    np.testing.assert_array_equal(whole(path), SAMPLES.astype(np.float32))


def test_caf_of_unknown_length(tmp_path):
    path = tmp_path / "a.caf"
    content = written(path, form="CAF")
    with_size(path, b"data", struct.pack(">q", -1), content)
    np.testing.assert_array_equal(whole(path), SAMPLES.astype(np.float32))


def test_aiff_that_was_never_finished(tmp_path):
    path = tmp_path / "a.aif"
    content = written(path, form="AIFF")
    at = content.index(b"COMM") + 10
    content[at : at + 4] = bytes(4)
    with_size(path, b"SSND", struct.pack(">I", 0), content)
    np.testing.assert_array_equal(whole(path), SAMPLES.astype(np.float32))
    content = written(path, form="AIFF")
    content[at : at + 4] = struct.pack(">I", 10**6)
    path.write_bytes(content)
    with pytest.raises(InputError, match="holds 600 of the 1000000 samples"):
        read(path)


class TestFlac:
    @pytest.mark.parametrize("length", [1, 100, 4096, 4097, 50_000])
    def test_of_unknown_length(self, tmp_path, length):
        path = tmp_path / "a.flac"
        samples = np.random.default_rng(length).integers(-30000, 30000, (length, 5)) / 2**15
        soundfile.write(path, samples, 2000, subtype="PCM_16")
        content = bytearray(path.read_bytes())
        content[21] &= 0xF0
        content[22:26] = bytes(4)
        path.write_bytes(content)
        recording = read(path)
        np.testing.assert_array_equal(recording.read(0, recording.length), samples.astype(np.float32))
        np.testing.assert_array_equal(recording.read(length // 2, length), samples[length // 2 :].astype(np.float32))
        assert recording.remarks == (
            f"The header does not tell its length; the file holds {length} samples, all of which are read.",
        )

    def test_longer_than_its_header_says(self, tmp_path):
        path = tmp_path / "a.flac"
        content = written(path)
        content[25] = 10
        path.write_bytes(content)
        np.testing.assert_array_equal(whole(path), SAMPLES.astype(np.float32))

    def test_of_unknown_length_and_cut_short(self, tmp_path):
        path = tmp_path / "a.flac"
        content = written(path)
        content[21] &= 0xF0
        content[22:26] = bytes(4)
        path.write_bytes(content[:-10])
        with pytest.raises(InputError, match="does not tell its length, and its last frame is damaged or cut short"):
            read(path)


def bext(day: bytes, time: bytes, samples: int) -> bytes:
    body = bytes(320) + day + time + struct.pack("<QH", samples, 1) + bytes(254)
    return b"bext" + struct.pack("<I", len(body)) + body


def with_chunk(path: Path, chunk: bytes) -> None:
    content = path.read_bytes()
    path.write_bytes(content[:12] + chunk + content[12:])


TEXT = (
    b"<BWFXML><BEXT><BWF_ORIGINATION_DATE>2024-02-29</BWF_ORIGINATION_DATE>"
    b"<BWF_ORIGINATION_TIME>12:00:07</BWF_ORIGINATION_TIME></BEXT></BWFXML>"
)
IXML = b"iXML" + struct.pack("<I", 200) + TEXT.ljust(200)


@pytest.mark.parametrize(
    ("chunk", "start"),
    [
        (bext(b"2024-02-29", b"12:00:00", 12 * 3600 * 2000 + 1), "2024-02-29T12:00:00.000500000"),
        (bext(b"2024:02:29", b"12-00-07", 0), "2024-02-29T12:00:07.000000000"),
        (bext(bytes(10), bytes(8), 0), None),
        (bext(b"2024-13-29", b"12:00:00", 0), None),
        (bext(b"2024-02-29", b"12:00:00", 2**63), None),
        (IXML, "2024-02-29T12:00:07.000000000"),
    ],
)
def test_when_it_began(tmp_path, chunk, start):
    written(tmp_path / "a.wav")
    with_chunk(tmp_path / "a.wav", chunk)
    recording = read(tmp_path / "a.wav")
    assert (None if recording.start_time is None else str(recording.start_time)) == start
    np.testing.assert_array_equal(recording.read(0, 600), SAMPLES.astype(np.float32))
