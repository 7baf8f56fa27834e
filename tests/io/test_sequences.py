"""Frames are read as they were written, a stretch at a time; what cannot be read is said in one sentence."""

import gc
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import tifffile
import xarray as xr
import zarr
from PIL import Image

from faintrack.beliefs.axis import Axis
from faintrack.errors import InputError
from faintrack.io import read_sequence
from faintrack.io.variables import open_npz
from tests.io.test_bad_input import sentence_about, shorten

FRAMES = np.random.default_rng(1).integers(0, 256, (12, 5, 7)).astype(np.uint8)
PIXELS = (("y", Axis(0.0, 1.0, 5)), ("x", Axis(0.0, 1.0, 7)))
MATRIX = np.random.default_rng(2).exponential(size=(6, 4)).astype(np.float32)


def write_tiff(path: Path, frames: np.ndarray, **options) -> None:
    tifffile.imwrite(path, frames, photometric="minisblack", **options)


def write_separate_pages(path: Path, frames: np.ndarray, **options) -> None:
    """Pages with their headers between them, as other programs write them."""
    with tifffile.TiffWriter(path, **options) as file:
        for frame in frames:
            file.write(frame, photometric="minisblack", metadata=None)


def write_pngs(path: Path, frames: np.ndarray) -> None:
    path.mkdir()
    for number, frame in enumerate(frames):
        Image.fromarray(frame).save(path / f"frame {number}.png")


def write_bare_zarr(path: Path, frames: np.ndarray, **options) -> None:
    zarr.create_array(path, data=frames, chunks=(1, *frames.shape[1:]), **options)


def write_xarray(path: Path, frames: np.ndarray, dims=("time", "y", "x"), version=3, **coords) -> None:
    data = xr.Dataset({"power": (dims, frames)}, coords=coords)
    data.to_zarr(path, zarr_format=version, consolidated=False)


def write_mat73(path: Path, **arrays: np.ndarray) -> None:
    """As MATLAB does: axes in reverse, vectors as matrices, its class beside the values."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays.items():
            file[name] = np.atleast_2d(values).T
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["remark"] = np.frombuffer(b"night", np.uint8).astype(np.uint16)[:, None]
        file["remark"].attrs["MATLAB_class"] = np.bytes_("char")
        file.create_group("#refs#")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file")


WRITERS: dict[str, tuple[str, Callable[[Path, np.ndarray], object]]] = {
    "npz": ("a.npz", lambda path, frames: np.savez(path, frames=frames, truth=np.zeros((2, 3)), note="night")),
    "npz compressed": ("a.npz", lambda path, frames: np.savez_compressed(path, frames=frames)),
    "npz Fortran order": ("a.npz", lambda path, frames: np.savez(path, frames=np.asfortranarray(frames))),
    "MAT": ("a.mat", lambda path, frames: scipy.io.savemat(path, {"frames": frames, "note": "night", "s": {"b": 1}})),
    "MAT compressed": ("a.mat", lambda path, frames: scipy.io.savemat(path, {"f": frames}, do_compression=True)),
    "MAT 7.3": ("a.mat", lambda path, frames: write_mat73(path, frames=frames)),
    "bare Zarr": ("a.zarr", write_bare_zarr),
    "bare Zarr 2": ("a.zarr", lambda path, frames: write_bare_zarr(path, frames, zarr_format=2)),
    "xarray": ("a.zarr", write_xarray),
    "xarray 2": ("a.zarr", lambda path, frames: write_xarray(path, frames, version=2)),
    "TIFF": ("a.tif", write_tiff),
    "TIFF of separate pages": ("A.TIFF", write_separate_pages),
    "TIFF compressed": ("a.tiff", lambda path, frames: write_tiff(path, frames, compression="zlib")),
    "TIFF big-endian": ("a.tif", lambda path, frames: write_tiff(path, frames, byteorder=">")),
    "BigTIFF": ("a.tif", lambda path, frames: write_tiff(path, frames, bigtiff=True)),
    "TIFF of ImageJ": ("a.tif", lambda path, frames: write_tiff(path, frames, imagej=True, metadata={"axes": "TYX"})),
    "PNG": ("a", write_pngs),
}
EVERY = pytest.mark.parametrize(("name", "write"), WRITERS.values(), ids=WRITERS)


@EVERY
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_what_is_written_is_read(tmp_path, name, write, dtype):
    if name == "a" and dtype == np.float32:
        pytest.skip("PNG holds whole numbers")
    frames = FRAMES.astype(dtype) * dtype(1 if dtype == np.uint8 else 250)
    write(tmp_path / name, frames)
    sequence = read_sequence(tmp_path / name)
    whole = sequence.read(0, sequence.length)
    np.testing.assert_array_equal(whole, frames)
    assert whole.dtype == np.float32
    assert sequence.axes == PIXELS
    assert sequence.times.tolist() == list(range(12))
    assert sequence.source == str(tmp_path / name)


@EVERY
def test_a_stretch_is_the_same_stretch_of_the_whole(tmp_path, name, write):
    write(tmp_path / name, FRAMES)
    sequence = read_sequence(str(tmp_path / name), frame_interval=0.25)
    np.testing.assert_array_equal(sequence.read(3, 5), FRAMES[3:5])
    assert sequence.read(4, 4).shape == (0, 5, 7)
    blocks = list(sequence.blocks(5))
    np.testing.assert_array_equal(np.concatenate([frames for _, frames in blocks]), FRAMES)
    np.testing.assert_array_equal(np.concatenate([times for times, _ in blocks]), 0.25 * np.arange(12))


@pytest.mark.parametrize("name", ["a.npz", "a.mat", "a.zarr"])
def test_double_precision_stays(tmp_path, name):
    values = np.full((3, 2), np.pi)
    write = {"a.npz": lambda p: np.savez(p, power=values), "a.mat": lambda p: scipy.io.savemat(p, {"power": values})}
    write.get(name, lambda path: write_bare_zarr(path, values))(tmp_path / name)
    assert (read_sequence(tmp_path / name).read(0, 3) == np.pi).all()


def test_mat_written_on_a_big_endian_machine(tmp_path):
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\x00MI"
    values = np.array([[1.0, 2.5], [3.0, 4.0], [5.0, 6.0]])
    numbers = values.T.astype(">f8").tobytes()
    body = np.array([6, 8, 6, 0, 5, 8, 3, 2], ">u4").tobytes()
    body += np.array([1, 5], ">u4").tobytes() + b"power\0\0\0" + np.array([9, len(numbers)], ">u4").tobytes() + numbers
    (tmp_path / "a.mat").write_bytes(header + np.array([14, len(body)], ">u4").tobytes() + body)
    sequence = read_sequence(tmp_path / "a.mat")
    np.testing.assert_array_equal(sequence.read(0, 3), values)
    assert sequence.read(0, 3).dtype.isnative


def test_png_files_in_natural_order_beside_other_files(tmp_path):
    write_pngs(tmp_path / "a", FRAMES)
    (tmp_path / "a" / "notes 3.txt").write_text("clear sky")
    (tmp_path / "a" / "frame 2.png").rename(tmp_path / "a" / "frame 02.PNG")
    np.testing.assert_array_equal(read_sequence(tmp_path / "a").read(0, 12), FRAMES)


@pytest.mark.parametrize("write", [write_separate_pages, write_pngs, write_bare_zarr])
@pytest.mark.parametrize("part", [np.s_[:1], np.s_[:, :1], np.s_[:, :, :1], np.s_[:1, :, :1]])
def test_axes_of_one_place(tmp_path, write, part):
    path = tmp_path / {write_pngs: "a", write_bare_zarr: "a.zarr"}.get(write, "a.tif")
    write(path, FRAMES[part])
    sequence = read_sequence(path)
    np.testing.assert_array_equal(sequence.read(0, sequence.length), FRAMES[part])


def test_tiff_of_one_row(tmp_path):
    write_tiff(tmp_path / "a.tif", FRAMES[:, :1])
    np.testing.assert_array_equal(read_sequence(tmp_path / "a.tif").read(0, 12), FRAMES[:, :1])


COORDINATES = {"time": 100.0 + np.array([0.0, 1.5, 2.0, 4.0, 4.5, 7.0]), "range": 50.0 + 2.5 * np.arange(4)}
CARRIERS: dict[str, Callable[..., None]] = {
    "a.npz": lambda path, **arrays: np.savez(path, **arrays),
    "a.mat": lambda path, **arrays: scipy.io.savemat(path, arrays),
    "b.mat": write_mat73,
    "a.zarr": lambda path, power, **coords: write_xarray(path, power, ("time", "range"), **coords),
    "b.zarr": lambda path, power, **coords: write_xarray(path, power, ("time", "range"), 2, **coords),
}


@pytest.mark.parametrize("name", CARRIERS)
def test_times_and_values_along_the_axes(tmp_path, name):
    CARRIERS[name](tmp_path / name, power=MATRIX, **COORDINATES)
    sequence = read_sequence(tmp_path / name)
    np.testing.assert_array_equal(sequence.times, COORDINATES["time"])
    assert sequence.axes == (("range", Axis(50.0, 2.5, 4)),)
    np.testing.assert_array_equal(sequence.read(0, 6), MATRIX)
    assert read_sequence(tmp_path / name, frame_interval=2.0).times.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]


@pytest.mark.parametrize("name", CARRIERS)
def test_axes_in_another_order(tmp_path, name):
    CARRIERS[name](tmp_path / name, power=MATRIX)
    sequence = read_sequence(tmp_path / name, "power", dims=("bearing", "time"))
    assert sequence.axes == (("bearing", Axis(0.0, 1.0, 6)),)
    np.testing.assert_array_equal(sequence.read(1, 3), MATRIX.T[1:3])


@pytest.mark.parametrize("version", [2, 3])
def test_axes_as_zarr_names_them(tmp_path, version):
    rates = np.linspace(6.0, -6.0, 5)
    write_xarray(
        tmp_path / "a.zarr", FRAMES, ("range", "range_rate", "time"), version, range_rate=rates, time=np.arange(7) * 0.1
    )
    sequence = read_sequence(tmp_path / "a.zarr")
    assert sequence.axes == (("range", Axis(0.0, 1.0, 12)), ("range_rate", Axis(-6.0, 3.0, 5)))
    expected = np.moveaxis(FRAMES, 2, 0)[2:6, :, ::-1]
    np.testing.assert_array_equal(sequence.read(2, 6), expected)
    np.testing.assert_array_equal(sequence.times, np.arange(7) * 0.1)


@pytest.mark.parametrize("unit", ["ns", "ms", "s", "m", "h", "D"])
def test_times_of_a_calendar_become_seconds(tmp_path, unit):
    times = np.datetime64("2024-05-01T12:00:00", "ns") + (np.arange(12) * 3 * np.timedelta64(1, unit))
    write_xarray(tmp_path / "a.zarr", FRAMES, time=times)
    found = read_sequence(tmp_path / "a.zarr").times
    np.testing.assert_allclose(np.diff(found), 3 * (np.timedelta64(1, unit) / np.timedelta64(1, "s")), rtol=1e-12)


def test_values_rounded_to_single_precision_are_evenly_spaced(tmp_path):
    ranges = (1e4 + 0.1 * np.arange(4000)).astype(np.float32)
    np.savez(tmp_path / "a.npz", power=np.ones((2, 4000)), range=ranges)
    ((_, axis),) = read_sequence(tmp_path / "a.npz").axes
    np.testing.assert_allclose(axis.values, ranges, atol=0.01)


def test_the_largest_array_is_the_frames_unless_another_is_named(tmp_path):
    np.savez(tmp_path / "a.npz", frames=FRAMES, matrix=MATRIX, range=np.arange(4) * 2.0)
    assert read_sequence(tmp_path / "a.npz").shape == (5, 7)
    assert read_sequence(tmp_path / "a.npz", variable="matrix").axes == (("range", Axis(0.0, 2.0, 4)),)


def test_four_axes_with_names(tmp_path):
    np.savez(tmp_path / "a.npz", cube=np.arange(120).reshape(2, 3, 4, 5))
    sequence = read_sequence(tmp_path / "a.npz", dims=("time", "range", "bearing", "range_rate"))
    assert sequence.shape == (3, 4, 5)
    np.testing.assert_array_equal(sequence.read(1, 2).ravel(), np.arange(60, 120))


class TestOnlyTheStretchIsRead:
    """What lies outside the stretch may be gone."""

    @pytest.mark.parametrize("version", [2, 3])
    def test_zarr(self, tmp_path, version):
        write_bare_zarr(tmp_path / "a.zarr", FRAMES, zarr_format=version)
        for number in set(range(12)) - {4, 5}:
            (tmp_path / "a.zarr" / (f"c/{number}/0/0" if version == 3 else f"{number}.0.0")).write_bytes(b"gone")
        sequence = read_sequence(tmp_path / "a.zarr")
        np.testing.assert_array_equal(sequence.read(4, 6), FRAMES[4:6])
        sentence_about(tmp_path / "a.zarr", lambda: sequence.read(4, 7))

    def test_png(self, tmp_path):
        write_pngs(tmp_path / "a", FRAMES)
        sequence = read_sequence(tmp_path / "a")
        for number in set(range(12)) - {4, 5}:
            (tmp_path / "a" / f"frame {number}.png").unlink()
        np.testing.assert_array_equal(sequence.read(4, 6), FRAMES[4:6])
        sentence_about(tmp_path / "a" / "frame 6.png", lambda: sequence.read(4, 7))

    def test_compressed_tiff(self, tmp_path):
        path = tmp_path / "a.tif"
        write_tiff(path, FRAMES, compression="zlib", metadata=None)
        with tifffile.TiffFile(path) as file:
            places = [page.dataoffsets[0] for page in file.pages]
        with path.open("r+b") as stream:
            for number in set(range(1, 12)) - {4, 5}:
                stream.seek(places[number])
                stream.write(b"gone")
        sequence = read_sequence(path)
        np.testing.assert_array_equal(sequence.read(4, 6), FRAMES[4:6])
        assert "cannot be read as TIFF (" in sentence_about(path, lambda: sequence.read(4, 7))

    @pytest.mark.parametrize("name", ["a.npz", "a.tif", "A.TIFF", "b.mat", "a.zarr"])
    def test_memory_stays_below_the_size_of_the_file(self, tmp_path, name):
        frames = np.ones((100, 200, 200), np.uint8)
        writers = {"a.npz": lambda p, f: np.savez(p, f=f), "b.mat": lambda p, f: write_mat73(p, f=f)}
        writers |= {"a.tif": write_tiff, "A.TIFF": write_separate_pages, "a.zarr": write_bare_zarr}
        writers[name](tmp_path / name, frames)
        sequence = read_sequence(tmp_path / name)
        sequence.read(0, 1)
        # Python's own, which a user has.
        before = gc.get_threshold()
        gc.set_threshold(700, 10, 10)
        tracemalloc.start()
        count = sum(len(block) for _, block in sequence.blocks(2))
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        gc.set_threshold(*before)
        assert count == 100
        assert peak < frames.nbytes / 4


@EVERY
class TestEveryFormat:
    def test_missing_or_empty(self, tmp_path, name, write):
        path = tmp_path / name
        assert sentence_about(path, lambda: read_sequence(path)).endswith("does not exist.")
        path.mkdir() if path.suffix in ("", ".zarr") else path.touch()
        empty = sentence_about(path, lambda: read_sequence(path))
        assert any(expected in empty for expected in (" is empty.", "holds no PNG file", "cannot be read as a Zarr"))

    def test_other_content(self, tmp_path, name, write):
        path = tmp_path / name
        write(path, FRAMES)
        inside = {"": "frame 7.png", ".zarr": "zarr.json"}.get(path.suffix)
        for content in (b"junk", bytes(5000), b"0123456789" * 500):
            (path / inside if inside else path).write_bytes(content)
            if name == "a.zarr":
                for remaining in (".zarray", ".zgroup"):
                    (path / remaining).unlink(missing_ok=True)
            sentence_about(path, lambda: read_sequence(path).read(0, 12))

    def test_cut_short(self, tmp_path, name, write):
        path = tmp_path / name
        frames = np.random.default_rng(3).integers(0, 256, (12, 50, 70)).astype(np.uint8)
        write(path, frames)
        files = [file for file in path.rglob("*") if file.is_file()]
        part = max(files, key=lambda file: file.stat().st_size, default=path)
        for fraction in (0.9, 0.6, 0.01):
            shorten(part, fraction)
            sentence_about(path, lambda: read_sequence(path).read(0, 12))

    def test_frames_with_nan(self, tmp_path, name, write):
        if name == "a":
            pytest.skip("PNG holds whole numbers")
        frames = FRAMES.astype(np.float32)
        frames[8, 2, 3] = np.nan
        write(tmp_path / name, frames)
        sequence = read_sequence(tmp_path / name)
        np.testing.assert_array_equal(sequence.read(0, 8), FRAMES[:8])
        sentence = sentence_about(tmp_path / name, lambda: sequence.read(6, 10))
        assert "frame 8 of " in sentence
        assert sentence.endswith("holds NaN or infinity; expected finite values.")


@pytest.mark.parametrize(
    ("arrays", "options", "expected"),
    [
        ({"f": FRAMES}, {"variable": "g"}, "there is no array g; the file holds f."),
        ({"f": FRAMES, "g": FRAMES}, {}, "f, g can each be the frames; expected variable to name one of them."),
        ({"i": FRAMES.ravel(), "q": FRAMES.ravel()}, {}, "no numeric array with 2 to 4 axes; the file holds i, q."),
        ({"f": FRAMES * 1j}, {}, "f holds complex128; expected real values, such as the power or the amplitude."),
        ({"f": FRAMES.astype(str)}, {"variable": "f"}, "f holds <U3; expected real numbers."),
        ({"f": FRAMES > 9}, {"variable": "f"}, "f holds bool; expected real numbers."),
        ({"f": FRAMES.astype(object)}, {"variable": "f"}, "f holds object; expected real numbers."),
        ({"f": FRAMES[:0]}, {}, "f has shape (0, 5, 7); expected at least one frame and one cell."),
        ({"f": FRAMES[None]}, {}, "f has shape (1, 12, 5, 7); expected dims to name its axes."),
        ({"f": FRAMES}, {"dims": ("time", "range")}, "f has shape (12, 5, 7); expected the axes time, range."),
        ({"f": MATRIX}, {"dims": ("y", "x")}, "f has the axes y, x; expected dims with different names, one of them"),
        ({"f": FRAMES}, {"dims": ("time", "x", "x")}, "f has the axes time, x, x; expected dims with different names"),
        ({"f": MATRIX}, {"frame_interval": 0.0}, "frame_interval is 0; expected seconds above 0."),
        ({"f": MATRIX}, {"frame_interval": np.nan}, "frame_interval is nan; expected seconds above 0."),
        ({"f": MATRIX, "time": np.zeros(4)}, {}, "time has shape (4,); expected (6,), one value for each place of its"),
        ({"f": MATRIX, "time": np.zeros(6)}, {}, "the time of frame 1 is not after the one before; expected ascending"),
        ({"f": MATRIX, "time": ["a"] * 6}, {}, "time holds <U1; expected real numbers."),
        ({"f": MATRIX, "range": [0, 1, np.nan, 3]}, {}, "range holds NaN or infinity at index 2; expected numbers."),
        ({"f": MATRIX, "range": [0.0, 1.0, 2.0, 3.3]}, {}, "range is uneven at index 3, 3.3 after 2; expected evenly"),
        ({"f": MATRIX, "range": [0.0, 2.0, 2.5, 3.0]}, {}, "range is uneven at index 1, 2 after 0; expected evenly"),
        (
            {"f": MATRIX, "range": [5.0] * 4},
            {},
            "range is uneven at index 1, 5 after 5; expected evenly spaced values.",
        ),
    ],
)
def test_arrays_that_do_not_fit(tmp_path, arrays, options, expected):
    path = tmp_path / "a.npz"
    np.savez(path, **arrays)
    assert expected in sentence_about(path, lambda: read_sequence(path, **options))


def test_complex_values_of_every_carrier(tmp_path):
    for name, write in CARRIERS.items():
        if name == "b.mat":
            pairs = np.zeros((4, 6), [("real", float), ("imag", float)])
            with h5py.File(tmp_path / name, "w") as file:
                file["power"] = pairs
        else:
            write(tmp_path / name, power=MATRIX * 1j)
        path = tmp_path / name
        assert "expected real values" in sentence_about(path, lambda path=path: read_sequence(path))


def test_zarr_that_needs_more_than_its_values(tmp_path):
    path = tmp_path / "a.zarr"
    write_xarray(path, MATRIX, ("time", "range"))
    power = zarr.open(path)["power"]
    power.attrs["scale_factor"] = 0.5
    sentence = sentence_about(path, lambda: read_sequence(path))
    assert sentence.endswith("power is packed with scale_factor; expected plain values.")
    write_xarray(tmp_path / "b.zarr", MATRIX, ("time", "range"), time=("time", np.arange(6), {"units": "fortnights"}))
    sentence = sentence_about(tmp_path / "b.zarr", lambda: read_sequence(tmp_path / "b.zarr"))
    assert "time has the units 'fortnights'; expected one of days, hours," in sentence
    write_xarray(tmp_path / "c.zarr", MATRIX, ("frame", "range"))
    sentence = sentence_about(tmp_path / "c.zarr", lambda: read_sequence(tmp_path / "c.zarr"))
    assert "power has the axes frame, range; expected dims with different names, one of them time." in sentence


def test_pictures_that_do_not_fit_together(tmp_path):
    write_pngs(tmp_path / "a", FRAMES)
    Image.fromarray(FRAMES[0, :4]).save(tmp_path / "a" / "frame 5.png")
    sentence = sentence_about(tmp_path / "a" / "frame 5.png", lambda: read_sequence(tmp_path / "a"))
    assert sentence.endswith("frame 5.png is (4, 7) uint8 and frame 0.png (5, 7) uint8; expected one kind.")
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for frame in (FRAMES[0], FRAMES[1, :4]):
            file.write(frame, photometric="minisblack", metadata=None)
    sentence = sentence_about(tmp_path / "a.tif", lambda: read_sequence(tmp_path / "a.tif"))
    assert sentence.endswith("a.tif holds pages of (5, 7) uint8 and (4, 7) uint8; expected one size and type.")
    write_tiff(tmp_path / "b.tif", FRAMES.reshape(3, 4, 5, 7))
    sentence = sentence_about(tmp_path / "b.tif", lambda: read_sequence(tmp_path / "b.tif"))
    assert sentence.endswith("b.tif has shape (3, 4, 5, 7); expected one axis, time, before y and x.")


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "LA", "P", "1"])
def test_png_in_colour(tmp_path, mode):
    write_pngs(tmp_path / "a", FRAMES)
    path = tmp_path / "a" / "frame 3.png"
    Image.new(mode, (7, 5), (1, 2, 3) if mode == "RGB" else None).save(path)
    sentence = sentence_about(path, lambda: read_sequence(tmp_path / "a").read(0, 12))
    assert "; expected a grey image" in sentence or "holds RGB pages; expected grey images" in sentence


@pytest.mark.parametrize("photometric", ["rgb", "miniswhite"])
def test_tiff_in_colour(tmp_path, photometric):
    frames = np.arange(210 if photometric == "rgb" else 70, dtype=np.uint8)
    frames = frames.reshape((2, 5, 7, 3) if photometric == "rgb" else (2, 5, 7))
    tifffile.imwrite(tmp_path / "a.tif", frames, photometric=photometric)
    sentence = sentence_about(tmp_path / "a.tif", lambda: read_sequence(tmp_path / "a.tif"))
    assert sentence.endswith(f"holds {photometric.upper()} pages; expected grey images in which black is 0.")


def test_tiff_whose_compression_is_unknown(tmp_path):
    write_tiff(tmp_path / "a.tif", FRAMES, compression="zlib")
    content = bytearray((tmp_path / "a.tif").read_bytes())
    entry = np.array([259, 3, 1, 0, 8, 0], "<u2").tobytes()
    for place in [place for place in range(len(content)) if content[place : place + 12] == entry]:
        content[place + 8] = 9
    (tmp_path / "a.tif").write_bytes(content)
    sentence = sentence_about(tmp_path / "a.tif", lambda: read_sequence(tmp_path / "a.tif"))
    assert "a.tif cannot be read as TIFF (" in sentence


def test_unknown_suffix(tmp_path):
    (tmp_path / "a.avi").touch()
    sentence = sentence_about(tmp_path / "a.avi", lambda: read_sequence(tmp_path / "a.avi"))
    assert "expected .npz, .npy, .mat, .zarr, .h5, .hdf5, .tif or .tiff, or a folder of images." in sentence


def test_a_file_lost_after_opening(tmp_path):
    np.savez(tmp_path / "a.npz", frames=FRAMES)
    sequence = read_sequence(tmp_path / "a.npz")
    (tmp_path / "a.npz").unlink()
    with pytest.raises(InputError, match="cannot be read as npz"):
        sequence.read(0, 1)


def test_headers_of_npz_are_read_alone(tmp_path):
    np.savez(tmp_path / "a.npz", frames=FRAMES, names=np.array(["a", None], object))
    shapes = {name: variable.shape for name, variable in open_npz(tmp_path / "a.npz").items()}
    assert shapes == {"frames": (12, 5, 7), "names": (2,)}
