"""HDF5, Zarr, npz and MAT: what is not there is missing and not zero, and no header is believed before it is seen."""

import json
import struct
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import zarr

from faintrack.errors import InputError
from faintrack.io import read, read_sequence, write_recording
from faintrack.io.variables import open_mat, open_npz
from tests.io.test_bad_input import sentence_about

NOISE = np.random.default_rng(8).normal(size=(1000, 3)).astype(np.float32)


def hdf5(path: Path, **options: object) -> h5py.Dataset:
    file = h5py.File(path, "w")
    dataset = file.create_dataset("time_data", **options)
    dataset.attrs["sample_freq"] = 100.0
    return dataset


def whole(recording):
    return recording.read(0, recording.length)


class TestHdf5:
    @pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int16])
    def test_chunks_that_were_never_written(self, tmp_path, dtype):
        dataset = hdf5(tmp_path / "a.h5", shape=(1000, 3), chunks=(100, 2), dtype=dtype)
        values = (NOISE * 100).astype(dtype)
        dataset[:300], dataset[600:, :2] = values[:300], values[600:, :2]
        dataset.file.close()
        expected = values.astype(np.float64 if dtype == np.float64 else np.float32)
        expected[300:600], expected[600:, 2] = np.nan, np.nan
        recording = read(tmp_path / "a.h5")
        np.testing.assert_array_equal(whole(recording), expected)
        np.testing.assert_array_equal(recording.read(250, 651), expected[250:651])

    def test_an_array_that_was_never_written(self, tmp_path):
        hdf5(tmp_path / "a.h5", shape=(1000, 3), dtype="f4").file.close()
        assert "was made and never written" in sentence_about(tmp_path, lambda: read(tmp_path / "a.h5"))

    @pytest.mark.parametrize("name", ["fillvalue", "_FillValue", "missing_value"])
    def test_values_that_stand_for_none(self, tmp_path, name):
        values = np.arange(600, dtype=np.int16).reshape(200, 3)
        values[50:60, 1] = -999
        options = {"fillvalue": -999} if name == "fillvalue" else {}
        dataset = hdf5(tmp_path / "a.h5", data=values, **options)
        if not options:
            dataset.attrs[name] = np.int16(-999)
        dataset.file.close()
        samples = whole(read(tmp_path / "a.h5"))
        assert np.isnan(samples[50:60, 1]).all()
        assert np.isnan(samples).sum() == 10

    def test_zero_is_a_value(self, tmp_path):
        values = np.random.default_rng(2).integers(0, 3, (200, 3)).astype(np.int16)
        hdf5(tmp_path / "a.h5", data=values).file.close()
        np.testing.assert_array_equal(whole(read(tmp_path / "a.h5")), values)

    def test_samples_in_another_file(self, tmp_path):
        (tmp_path / "secret.bin").write_bytes(NOISE.tobytes())
        hdf5(tmp_path / "a.h5", shape=NOISE.shape, dtype="f4", external=[("secret.bin", 0, NOISE.nbytes)]).file.close()
        assert "stands in another file, 'secret.bin'" in sentence_about(tmp_path, lambda: read(tmp_path / "a.h5"))

    def virtual(self, path: Path, parts: int) -> None:
        layout = h5py.VirtualLayout(shape=(1000, 3), dtype="f4")
        for number in range(parts):
            rows = slice(number * 500, number * 500 + 500)
            with h5py.File(path / f"part{number}.h5", "w") as file:
                file["x"] = NOISE[rows]
            layout[rows] = h5py.VirtualSource(f"part{number}.h5", "x", shape=(500, 3))
        with h5py.File(path / "a.h5", "w") as file:
            file.create_virtual_dataset("time_data", layout).attrs["sample_freq"] = 100.0

    def test_virtual_datasets_are_whole_or_refused(self, tmp_path):
        self.virtual(tmp_path, 2)
        np.testing.assert_array_equal(whole(read(tmp_path / "a.h5")), NOISE)
        (tmp_path / "part1.h5").unlink()
        assert "x of part1.h5 is not there" in sentence_about(tmp_path, lambda: read(tmp_path / "a.h5"))
        self.virtual(tmp_path, 1)
        assert "which fill 1500 of 3000 values" in sentence_about(tmp_path, lambda: read(tmp_path / "a.h5"))

    def test_shapes_that_nothing_fills(self, tmp_path):
        for shape, chunks in (((10**12, 3), (100, 3)), ((10, 10**9), (1, 100))):
            dataset = hdf5(tmp_path / "a.h5", shape=shape, chunks=chunks, dtype="f4")
            dataset[:1, :3] = 1
            dataset.file.close()
            sentence_about(tmp_path, lambda: read(tmp_path / "a.h5"))

    def test_complex_samples(self, tmp_path):
        hdf5(tmp_path / "a.h5", data=NOISE + 1j).file.close()
        assert "need a beamformer of both sides" in sentence_about(tmp_path, lambda: read(tmp_path / "a.h5"))

    def test_the_other_way_round(self, tmp_path):
        hdf5(tmp_path / "a.h5", data=NOISE.T).file.close()
        assert "the other way round" in sentence_about(tmp_path, lambda: read(tmp_path / "a.h5"))


class TestZarr:
    @pytest.mark.parametrize("version", [2, 3])
    @pytest.mark.parametrize("fill", [0, 7])
    def test_chunks_that_are_not_there(self, tmp_path, version, fill):
        group = zarr.open_group(tmp_path / "a.zarr", mode="w", zarr_format=version, attributes={"sample_rate": 100.0})
        group.create_array("time_data", shape=(1000, 3), chunks=(100, 3), dtype="f4", fill_value=fill)[:] = NOISE
        gone = tmp_path / "a.zarr/time_data" / ("c/4/0" if version == 3 else "4.0")
        gone.unlink()
        expected = NOISE.copy()
        expected[400:500] = np.nan
        recording = read(tmp_path / "a.zarr")
        np.testing.assert_array_equal(whole(recording), expected)
        np.testing.assert_array_equal(recording.read(390, 410), expected[390:410])

    def test_a_codec_that_runs_code(self, tmp_path):
        write_recording(tmp_path / "a.zarr", [NOISE], 100.0)
        place = tmp_path / "a.zarr/time_data/zarr.json"
        told = json.loads(place.read_text())
        told["codecs"] = [{"name": "numcodecs.pickle", "configuration": {}}]
        place.write_text(json.dumps(told))
        sentence_about(tmp_path, lambda: whole(read(tmp_path / "a.zarr")))

    def test_pickled_objects_of_version_2(self, tmp_path):
        folder = tmp_path / "a.zarr"
        folder.mkdir()
        (folder / ".zarray").write_text(json.dumps({
            "zarr_format": 2, "shape": [4, 4], "chunks": [4, 4], "dtype": "|O", "compressor": None, "fill_value": None,
            "order": "C", "filters": [{"id": "pickle", "protocol": 5}],
        }))  # fmt: skip
        (folder / "0.0").write_bytes(b"cos\nsystem\n(S'touch pwned'\ntR.")
        sentence_about(tmp_path, lambda: read_sequence(folder).read(0, 1))
        assert not Path("pwned").exists()

    @pytest.mark.parametrize("change", [{"shape": [10**12, 3]}, {"shape": [10, 10**9]}, {"shape": [10**12, 10**6]}])
    def test_shapes_that_nothing_fills(self, tmp_path, change):
        write_recording(tmp_path / "a.zarr", [NOISE], 100.0)
        place = tmp_path / "a.zarr/time_data/zarr.json"
        place.write_text(json.dumps(json.loads(place.read_text()) | change))
        sentence_about(tmp_path, lambda: read(tmp_path / "a.zarr"))

    def test_chunks_that_no_memory_holds(self, tmp_path):
        write_recording(tmp_path / "a.zarr", [NOISE], 100.0)
        place = tmp_path / "a.zarr/time_data/zarr.json"
        told = json.loads(place.read_text())
        told["chunk_grid"]["configuration"]["chunk_shape"] = [10**9, 3]
        place.write_text(json.dumps(told))
        assert "chunks of 12000000000 bytes" in sentence_about(tmp_path, lambda: read(tmp_path / "a.zarr"))


def npz_that_claims(path: Path, shape: tuple[int, ...], packed: bool) -> None:
    """An npz file of some hundred bytes with a shape in its header."""
    np.savez_compressed(path, frames=np.zeros((4, 4, 4)))
    import io
    import zipfile

    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED) as archive:
        archive.writestr("frames.npy", header.getvalue() + bytes(512))


class TestNpz:
    @pytest.mark.parametrize("packed", [True, False])
    @pytest.mark.parametrize("shape", [(10**9, 4, 4), (4, 2**40), (4, 4, 5)])
    def test_shapes_that_nothing_fills(self, tmp_path, shape, packed):
        npz_that_claims(tmp_path / "a.npz", shape, packed)
        sentence = sentence_about(tmp_path, lambda: open_npz(tmp_path / "a.npz"))
        assert "has shape" in sentence

    def test_pickles_are_not_read(self, tmp_path):
        class Evil:
            def __reduce__(self):
                return (Path("pwned").touch, ())

        np.savez(tmp_path / "a.npz", frames=np.array([[Evil(), None]] * 3, object), x=NOISE)
        sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a.npz", "frames"))
        np.save(tmp_path / "a.npy", np.array([[Evil(), None]] * 3, object), allow_pickle=True)
        sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a.npy"))
        assert not Path("pwned").exists()


def test_npy(tmp_path):
    for frames in (NOISE, np.asfortranarray(NOISE), NOISE.astype(">f8")):
        np.save(tmp_path / "a.npy", frames)
        np.testing.assert_array_equal(read_sequence(tmp_path / "a.npy").read(0, 1000), frames)
    content = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy").write_bytes(content[:-8])
    assert "in a file of" in sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a.npy"))


class TestTimesOfFrames:
    FRAMES = np.random.default_rng(1).normal(size=(9, 8, 7))

    @pytest.mark.parametrize("name", ["times", "time_s", "timestamps", "t"])
    def test_names_of_other_programs(self, tmp_path, name):
        np.savez(tmp_path / "a.npz", frames=self.FRAMES, **{name: 0.04 * np.arange(9)})
        sequence = read_sequence(tmp_path / "a.npz")
        np.testing.assert_array_equal(sequence.times, 0.04 * np.arange(9))
        assert sequence.remarks == (f"The times are those of {name}, in seconds.",)

    def test_two_of_them_are_asked_for(self, tmp_path):
        np.savez(tmp_path / "a.npz", frames=self.FRAMES, t=np.arange(9), times=np.arange(9) * 2.0)
        assert "times and t can each be the times" in sentence_about(
            tmp_path, lambda: read_sequence(tmp_path / "a.npz")
        )
        sequence = read_sequence(tmp_path / "a.npz", coordinates={"time": "times"})
        assert sequence.times[-1] == 16

    def test_dates(self, tmp_path):
        moments = np.datetime64("2024-02-29T23:59:58", "ms") + np.arange(9) * np.timedelta64(500, "ms")
        np.savez(tmp_path / "a.npz", frames=self.FRAMES, time=moments)
        sequence = read_sequence(tmp_path / "a.npz")
        assert sequence.times[-1] == 4.0
        assert sequence.start_time == moments[0]


class TestMatAndHdf5Vectors:
    POWER = np.random.default_rng(1).exponential(size=(20, 30))

    def save(self, path: Path, **arrays: np.ndarray) -> Path:
        if path.suffix == ".mat":
            scipy.io.savemat(path, arrays)
        else:
            with h5py.File(path, "w") as file:
                file.update(arrays)
        return path

    @pytest.mark.parametrize("name", ["a.mat", "a.h5"])
    def test_the_one_that_fits_is_taken_and_told(self, tmp_path, name):
        path = self.save(tmp_path / name, p=self.POWER, rng=100 + 5.0 * np.arange(30), truth=np.full(20, 3.0))
        sequence = read_sequence(path)
        assert sequence.axes[0][1].first == 100.0
        assert sequence.remarks == ("The values along range are those of rng, the one array that fits.",)

    @pytest.mark.parametrize("name", ["a.mat", "a.h5"])
    def test_two_that_fit_are_asked_for(self, tmp_path, name):
        path = self.save(tmp_path / name, p=self.POWER, r=5.0 * np.arange(30), k=np.arange(30.0))
        assert "can each be the values of range" in sentence_about(path, lambda: read_sequence(path))
        assert read_sequence(path, coordinates={"range": "r"}).axes[0][1].step == 5.0

    def test_a_name_that_fits_another_axis_moves_it(self, tmp_path):
        path = self.save(tmp_path / "a.mat", p=self.POWER.T, time=0.5 * np.arange(20))
        sequence = read_sequence(path)
        assert sequence.times[-1] == 9.5
        np.testing.assert_array_equal(sequence.read(3, 5), self.POWER[3:5])
        assert "The axes of p are range, time" in sequence.remarks[0]

    def test_structures(self, tmp_path):
        scipy.io.savemat(
            tmp_path / "a.mat", {"scan": {"p": self.POWER, "inner": {"x": np.arange(3.0)}, "note": "night"}}
        )
        assert sorted(open_mat(tmp_path / "a.mat")) == ["scan.inner.x", "scan.note", "scan.p"]
        np.testing.assert_array_equal(read_sequence(tmp_path / "a.mat").read(0, 20), self.POWER)


class TestMat:
    @pytest.mark.parametrize("dtype", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
    @pytest.mark.parametrize("packed", [True, False])
    def test_the_same_as_scipy(self, tmp_path, dtype, packed):
        frames = np.random.default_rng(2).integers(0, 100, (4, 5, 6)).astype(dtype)
        scipy.io.savemat(tmp_path / "a.mat", {"f": frames, "v": frames[0, 0]}, do_compression=packed)
        found = open_mat(tmp_path / "a.mat")
        np.testing.assert_array_equal(found["f"].read((slice(1, 3), slice(None), slice(0, 2))), frames[1:3, :, :2])
        assert found["f"].dtype == np.dtype(dtype)
        np.testing.assert_array_equal(found["v"].read((slice(None),)), frames[0, 0])

    def test_version_4(self, tmp_path):
        scipy.io.savemat(tmp_path / "a.mat", {"f": NOISE, "t": np.arange(1000.0)}, format="4")
        found = open_mat(tmp_path / "a.mat")
        np.testing.assert_array_equal(found["f"].read((slice(None), slice(None))), NOISE)
        assert found["t"].shape == (1000,)

    def test_complex_values(self, tmp_path):
        scipy.io.savemat(tmp_path / "a.mat", {"f": NOISE * 1j})
        assert "expected real values" in sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a.mat"))

    def test_a_bomb(self, tmp_path):
        """Ten megabytes of zeros that claim to be a hundred bytes, and the other way round."""
        head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
        for claimed, held in ((2**31 - 1, 100), (100, 10**7)):
            packed = zlib.compress(struct.pack("<II", 14, claimed) + bytes(held))
            (tmp_path / "a.mat").write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
            sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a.mat"))


def test_pipes_and_devices_are_refused(tmp_path):
    import os

    os.mkfifo(tmp_path / "a.wav")
    assert "is a pipe, a socket or a device" in sentence_about(tmp_path, lambda: read(tmp_path / "a.wav"))
    (tmp_path / "b.h5").symlink_to("/dev/zero")
    assert "is a pipe, a socket or a device" in sentence_about(tmp_path, lambda: read(tmp_path / "b.h5"))


def test_one_file_twice(tmp_path):
    write_recording(tmp_path / "a.wav", [NOISE], 100.0)
    with pytest.raises(InputError, match=r"a\.wav is given twice; expected each once"):
        read(tmp_path / "a.wav", tmp_path / "a.wav")
    (tmp_path / "b.wav").hardlink_to(tmp_path / "a.wav")
    with pytest.raises(InputError, match=r"b\.wav is given twice, also as .*a\.wav"):
        read(tmp_path / "a.wav", tmp_path / "b.wav")


def test_copies_are_missing(tmp_path):
    write_recording(tmp_path / "a.wav", [NOISE], 100.0)
    write_recording(tmp_path / "b.wav", [NOISE[:, [1]]], 100.0)
    recording = read(tmp_path / "a.wav", tmp_path / "b.wav")
    np.testing.assert_array_equal(whole(recording)[:, :3], NOISE)
    assert np.isnan(whole(recording)[:, 3]).all()
    assert recording.remarks == ("Channel 3 is a copy of channel 1; it is missing.",)


def test_silent_channels_are_no_copies(tmp_path):
    samples = NOISE.copy()
    samples[:, 1:] = 0
    write_recording(tmp_path / "a.wav", [samples], 100.0)
    assert read(tmp_path / "a.wav").remarks == ()


def test_starts_in_names(tmp_path):
    for number, late in ((0, "00"), (1, "02")):
        write_recording(tmp_path / f"node{number}_20240229_1200{late}.wav", [NOISE[:, [number]]], 100.0)
    files = sorted(tmp_path.glob("*.wav"))
    recording = read(files, start_pattern="%Y%m%d_%H%M%S")
    assert str(recording.start_time) == "2024-02-29T12:00:00.000000000"
    assert recording.length == 1200
    np.testing.assert_array_equal(recording.read(200, 1000)[:, 0], NOISE[200:, 0])
    np.testing.assert_array_equal(recording.read(200, 1000)[:, 1], NOISE[:800, 1])
    with pytest.raises(InputError, match="there is no time such as '%H-%M' in the name"):
        read(files, start_pattern="%H-%M")
    with pytest.raises(InputError, match="the pattern of start times is 'noon'"):
        read(files, start_pattern="noon")
