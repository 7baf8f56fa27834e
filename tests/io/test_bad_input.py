"""Whatever is wrong with a file is said in one sentence that names the file, and the field where there is one."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.io import read, read_array, write_recording

BLOCK = np.arange(6000, dtype=np.float32).reshape(3000, 2)
START = np.datetime64("2024-05-01T12:00:00", "ns")
TRIANGLE = "channels = [{name='a', x=0, y=0}, {name='b', x=1, y=0}, {name='c', x=0, y=1}]\n"


def sentence_about(path: Path, act: Callable[[], object]) -> str:
    with pytest.raises(InputError) as raised:
        act()
    sentence = str(raised.value)
    assert str(path) in sentence
    assert "\n" not in sentence
    assert sentence.endswith((".", "?"))
    return sentence


def write_hdf5(path: Path, samples: object = BLOCK, name: str = "time_data", **attributes: object) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file[name] = samples
        file[name].attrs.update({"sample_freq": 100.0} | attributes)


def write_seismic(path: Path, kind: str, length: int = 3000, **header: object) -> None:
    obspy = pytest.importorskip("obspy")
    rng = np.random.default_rng(6)
    trace = obspy.Trace(rng.integers(-9999, 9999, length).astype(np.int32))
    trace.stats.update({"sampling_rate": 100.0, "station": "A", "starttime": obspy.UTCDateTime(str(START))} | header)
    trace.write(str(path), format=kind)


def shorten(path: Path, fraction: float = 0.6) -> None:
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * fraction)])


@pytest.mark.parametrize(
    "name", ["rec.wav", "rec.flac", "rec.h5", "rec.hdf5", "rec.zarr", "rec.sac", "rec.mseed", "rec.miniseed", "rec.ms"]
)
class TestEveryFormat:
    def test_missing(self, tmp_path, name):
        assert sentence_about(tmp_path / name, lambda: read(tmp_path / name)).endswith("does not exist.")

    def test_of_the_wrong_kind(self, tmp_path, name):
        if name.endswith(".zarr"):
            (tmp_path / name).touch()
            expected = "is a file; expected a Zarr folder."
        else:
            (tmp_path / name).mkdir()
            expected = "is a folder; expected a file."
        assert sentence_about(tmp_path / name, lambda: read(tmp_path / name)).endswith(expected)

    def test_empty(self, tmp_path, name):
        if name.endswith(".zarr"):
            (tmp_path / name).mkdir()
            expected = "cannot be read as a Zarr folder"
        else:
            (tmp_path / name).touch()
            expected = "is empty."
        assert expected in sentence_about(tmp_path / name, lambda: read(tmp_path / name))

    @pytest.mark.parametrize("content", [b"junk", bytes(5000), b"0123456789" * 500], ids=["short", "zeros", "digits"])
    def test_of_other_content(self, tmp_path, name, content):
        if name.endswith(".zarr"):
            (tmp_path / name).mkdir()
            (tmp_path / name / "zarr.json").write_bytes(content)
        else:
            (tmp_path / name).write_bytes(content)
        sentence_about(tmp_path / name, lambda: read(tmp_path / name))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("rec.wav", "of the 24000 bytes of samples that its header promises."),
        ("rec.flac", "rec.flac cannot be read as FLAC"),
        ("rec.h5", "rec.h5 cannot be read as HDF5"),
        ("rec.sac", "of the 3000 samples that its header promises."),
        ("rec.mseed", "rec.mseed is damaged or cut short: only"),
    ],
)
def test_cut_short(tmp_path, name, expected):
    path = tmp_path / name
    if name.endswith((".sac", ".mseed")):
        write_seismic(path, {"sac": "SAC", "mseed": "MSEED"}[path.suffix[1:]])
    elif name.endswith(".flac"):
        pytest.importorskip("soundfile").write(path, np.random.default_rng(7).uniform(-1, 1, (9000, 2)), 100)
    else:
        write_recording(path, [BLOCK], 100.0)
    shorten(path)
    assert expected in sentence_about(path, lambda: read(path))


def test_wav_without_samples(tmp_path):
    pytest.importorskip("soundfile").write(tmp_path / "rec.wav", np.zeros((0, 2)), 100)
    assert "there are no samples." in sentence_about(tmp_path / "rec.wav", lambda: read(tmp_path / "rec.wav"))


def test_wav_header_without_data_chunk(tmp_path):
    (tmp_path / "rec.wav").write_bytes(b"RIFF" + struct.pack("<I", 4) + b"WAVE")
    assert "ends before its samples begin." in sentence_about(tmp_path, lambda: read(tmp_path / "rec.wav"))


def test_wav_of_unknown_length_is_read_to_its_end(tmp_path):
    write_recording(tmp_path / "rec.wav", [BLOCK], 100.0)
    content = bytearray((tmp_path / "rec.wav").read_bytes())
    place = content.index(b"data") + 4
    content[place : place + 4] = b"\xff" * 4
    (tmp_path / "rec.wav").write_bytes(content)
    assert read(tmp_path / "rec.wav").length == 3000


@pytest.mark.parametrize("name", ["rec.wav", "rec.h5", "rec.zarr", "rec.sac", "rec.mseed"])
def test_damage_after_opening(tmp_path, name):
    path = tmp_path / name
    if name.endswith((".sac", ".mseed")):
        write_seismic(path, {"sac": "SAC", "mseed": "MSEED"}[path.suffix[1:]])
    else:
        write_recording(path, [BLOCK], 100.0)
    recording = read(path)
    damaged = path / "time_data/c/0/0" if path.is_dir() else path
    damaged.write_bytes(b"gone")
    sentence_about(path, lambda: recording.read(0, recording.length))
    if path.is_file():
        path.unlink()
        sentence_about(path, lambda: recording.read(0, recording.length))


@pytest.mark.parametrize(
    ("samples", "name", "attributes", "expected"),
    [
        (BLOCK, "data", {}, " has no dataset time_data; it holds data."),
        (BLOCK[:, 0], "time_data", {}, ": time_data has shape (3000,); expected two axes, (time, channel)."),
        (BLOCK[:0], "time_data", {}, ": there are no samples."),
        (BLOCK * 1j, "time_data", {}, ": time_data holds complex64; expected real numbers."),
        ([[b"a", b"b"]], "time_data", {}, ": time_data holds object; expected real numbers."),
        (BLOCK, "time_data", {"sample_freq": 0.0}, ": the sample rate is 0.0, expected a number above 0 Hz."),
        (BLOCK, "time_data", {"sample_freq": np.nan}, ": the sample rate is nan, expected a number above 0 Hz."),
        (BLOCK, "time_data", {"sample_freq": "fast"}, ": sample_freq is 'fast'; expected one number in Hz."),
        (BLOCK, "time_data", {"sample_freq": [1.0, 2.0]}, "; expected one number in Hz."),
        (BLOCK, "time_data", {"channel_names": ["a"]}, ": channel_names has 1 names; time_data has 2 channels."),
        (BLOCK, "time_data", {"start_time": "noon"}, ": start_time is 'noon'; expected a UTC time such as"),
        (BLOCK, "time_data", {"start_time": "2024-13-01"}, ": start_time is '2024-13-01'; expected a UTC time such as"),
        (BLOCK, "time_data", {"start_time": "2024-05-01T12:00:00+02:00"}, "; expected a UTC time such as"),
    ],
)
def test_hdf5_of_another_layout(tmp_path, samples, name, attributes, expected):
    path = tmp_path / "rec.h5"
    write_hdf5(path, samples, name, **attributes)
    assert expected in sentence_about(path, lambda: read(path))


def test_hdf5_without_sample_rate(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "rec.h5", "w") as file:
        file["time_data"] = BLOCK
    sentence = sentence_about(tmp_path / "rec.h5", lambda: read(tmp_path / "rec.h5"))
    assert "time_data has no attribute sample_freq; expected the sample rate in Hz." in sentence


def test_zarr_without_time_data(tmp_path):
    zarr = pytest.importorskip("zarr")
    zarr.open_group(tmp_path / "rec.zarr", mode="w")
    sentence = sentence_about(tmp_path / "rec.zarr", lambda: read(tmp_path / "rec.zarr"))
    assert sentence.endswith("has no array time_data; it holds nothing.")


def test_sac_of_a_spectrum(tmp_path):
    sac = pytest.importorskip("obspy.io.sac")
    trace = sac.SACTrace(data=np.zeros(100, np.float32), iftype="irlim")
    trace.write(str(tmp_path / "a.sac"))
    sentence = sentence_about(tmp_path / "a.sac", lambda: read(tmp_path / "a.sac"))
    assert "is a SAC file of kind irlim; expected an evenly sampled time series." in sentence


def test_miniseed_channels_of_two_rates(tmp_path):
    obspy = pytest.importorskip("obspy")
    data = np.zeros(1000, np.float32)
    stream = obspy.Stream(obspy.Trace(data, {"station": s, "sampling_rate": r}) for s, r in (("A", 100), ("B", 50)))
    stream.write(str(tmp_path / "a.mseed"), format="MSEED")
    sentence = sentence_about(tmp_path / "a.mseed", lambda: read(tmp_path / "a.mseed"))
    assert sentence.endswith(".B.. has 50.0 Hz and .A.. 100.0 Hz; expected one sample rate.")


def test_miniseed_damaged_in_the_middle(tmp_path):
    path = tmp_path / "a.mseed"
    write_seismic(path, "MSEED", length=20_000)
    content = bytearray(path.read_bytes())
    content[4096:8192] = bytes(4096)
    path.write_bytes(content)
    assert "is damaged or cut short: only" in sentence_about(path, lambda: read(path))


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        ({"sample_rate": 50.0}, "b.h5 has 50 Hz and "),
        ({"start_time": None}, "only one tells when it starts; expected both or none."),
        ({"start_time": START + np.timedelta64(1, "D")}, "have no time in common."),
        ({"start_time": START + np.timedelta64(34, "ms")}, "b.h5: the start times differ by 3.40 samples"),
    ],
)
def test_files_that_do_not_belong_together(tmp_path, second, expected):
    write_recording(tmp_path / "a.h5", [BLOCK], 100.0, start_time=START)
    write_recording(tmp_path / "b.h5", [BLOCK], **({"sample_rate": 100.0, "start_time": START} | second))
    assert expected in sentence_about(tmp_path, lambda: read(tmp_path / "a.h5", tmp_path / "b.h5"))


def test_files_of_unequal_length_without_start_time(tmp_path):
    write_recording(tmp_path / "a.wav", [BLOCK], 100.0)
    write_recording(tmp_path / "b.wav", [BLOCK[:-1]], 100.0)
    sentence = sentence_about(tmp_path / "b.wav", lambda: read(tmp_path / "a.wav", tmp_path / "b.wav"))
    assert "b.wav has 2999 samples and " in sentence


def test_unknown_suffix_and_no_file_at_all(tmp_path):
    sentence = sentence_about(tmp_path / "rec.sio", lambda: read(tmp_path / "rec.sio"))
    assert "unknown kind of file; expected .wav, .flac, .w64, " in sentence
    assert sentence.endswith(" .sac, .mseed, .miniseed or .ms.")
    with pytest.raises(InputError, match="there is no file"):
        read()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sound_speed = ", "is not valid TOML ("),
        ("dead = []", "expected exactly one of channels, line and positions_file; found none."),
        (TRIANGLE + "line = {count = 2, spacing = 1.0}", "found channels and line."),
        (TRIANGLE + "sound_sped = 1.0", "there is no field sound_sped; did you mean sound_speed?"),
        (TRIANGLE + "sound_speed = '345'", "sound_speed is '345': input should be a valid number."),
        (TRIANGLE + "sound_speed = 0.0", "sound_speed is 0.0: input should be greater than 0."),
        (TRIANGLE + "sound_speed = inf", "sound_speed is inf: input should be a finite number."),
        (TRIANGLE + "dead = ['d']", "dead lists 'd'; the channels are a, b, c, or by number from 0."),
        (TRIANGLE + "inverted = [3]", "inverted lists 3; the channels are a, b, c, or by number from 0."),
        (TRIANGLE + "dead = [1.5]", "dead[0] is 1.5: expected the name of a channel or its number from 0."),
        (TRIANGLE + "dead = 1", "dead is 1: input should be a valid list."),
        (TRIANGLE + "dead = ['a', 1]", "the array has 1 channels in use; expected at least 2."),
        ("channels = []", "the array has 0 channels in use; expected at least 2."),
        ("channels = [{name = 'a', x = 1.0}]", "channels[0].y is missing."),
        ("channels = [{name = 'a', x = 1.0, y = nan}]", "channels[0].y is nan: input should be a finite number."),
        ("channels = [{name = 'a', x = 0, y = 0}, {name = 'b', x = 0, y = 0}]", "channels a and b have the same"),
        ("line = {count = 1, spacing = 1.0}", "line.count is 1: input should be greater than or equal to 2."),
        ("line = {count = 4, spacing = 0}", "line.spacing is 0: input should be greater than 0."),
        ("positions_file = 'absent.xml'", "absent.xml: the positions cannot be read (No such file or directory)."),
        ("positions_file = 'array.toml'", "array.toml is not valid XML ("),
    ],
)
def test_array_description(tmp_path, text, expected):
    path = tmp_path / "array.toml"
    path.write_text(text, encoding="utf-8")
    assert expected in sentence_about(path, lambda: read_array(path))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<MicArray><pos", "is not valid XML ("),
        ("<MicArray/>", "holds no positions; expected <pos Name x y z/> within <MicArray>."),
        ("<MicArray><pos x='1' y='2'/></MicArray>", "z of position 0 is ''; expected metres."),
        ("<MicArray><pos x='1' y='2' z='up'/></MicArray>", "z of position 0 is 'up'; expected metres."),
        ("<MicArray><pos x='1' y='2' z='0'/></MicArray>", "the array has 1 channels in use; expected at least 2."),
        ("<MicArray><pos x='nan' y='2' z='0'/></MicArray>", "positions and gains must be finite numbers."),
    ],
)
def test_array_positions(tmp_path, text, expected):
    path = tmp_path / "array.xml"
    path.write_text(text, encoding="utf-8")
    assert expected in sentence_about(path, lambda: read_array(path))


def test_array_file_missing_empty_or_unreadable(tmp_path):
    path = tmp_path / "array.toml"
    assert sentence_about(path, lambda: read_array(path)).endswith("does not exist.")
    path.touch()
    assert sentence_about(path, lambda: read_array(path)).endswith("is empty.")
    path.write_bytes(b"sound_speed = '\xff'")
    assert "is not valid TOML (" in sentence_about(path, lambda: read_array(path))
