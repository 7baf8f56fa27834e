"""Images and stacks: axes as the file says, times as the names say, and nothing guessed in silence."""

import struct
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

from faintrack.errors import InputError
from faintrack.io import read_sequence
from tests.io.test_bad_input import sentence_about

FRAMES = np.random.default_rng(1).integers(0, 60_000, (20, 6, 8)).astype(np.uint16)
OTHERS = FRAMES[::-1].copy()


def write(path: Path, frames: np.ndarray = FRAMES, **options: object) -> Path:
    tifffile.imwrite(path, frames, **options)
    return path


def frames_of(path: Path, **options: object) -> np.ndarray:
    sequence = read_sequence(path, **options)
    return sequence.read(0, sequence.length)


class TestAxes:
    @pytest.mark.parametrize(
        "options",
        [
            {"imagej": True, "metadata": {"axes": "TYX", "finterval": 0.04}},
            {"imagej": True, "metadata": {"axes": "TYX", "fps": 25.0}},
            {"ome": True, "metadata": {"axes": "TYX", "TimeIncrement": 0.04}},
            {"ome": True, "metadata": {"axes": "TYX", "TimeIncrement": 40.0, "TimeIncrementUnit": "ms"}},
        ],
    )
    def test_the_interval_is_the_files(self, tmp_path, options):
        path = write(tmp_path / "a.tif", **options)
        sequence = read_sequence(path)
        np.testing.assert_allclose(sequence.times, 0.04 * np.arange(20), rtol=1e-12)
        np.testing.assert_array_equal(sequence.read(0, 20), FRAMES)
        assert read_sequence(path, frame_interval=2.0).times[-1] == 38

    @pytest.mark.parametrize("options", [{"imagej": True}, {"ome": True}])
    @pytest.mark.parametrize("compression", [None, "zlib"])
    def test_channels_are_picked_and_never_taken_for_times(self, tmp_path, options, compression):
        both = np.stack([FRAMES, OTHERS], 1)
        path = write(tmp_path / "a.tif", both, metadata={"axes": "TCYX"}, compression=compression, **options)
        sentence = sentence_about(path, lambda: read_sequence(path))
        assert "2 places along its axis channel; expected select, such as channel: 0" in sentence
        np.testing.assert_array_equal(frames_of(path, select={"channel": 0}), FRAMES)
        np.testing.assert_array_equal(read_sequence(path, select={"channel": 1}).read(3, 7), OTHERS[3:7])
        assert "select has channel: 2" in sentence_about(path, lambda: read_sequence(path, select={"channel": 2}))

    @pytest.mark.parametrize(("letter", "name"), [("Z", "depth"), ("C", "channel")])
    def test_depths_alone_are_asked_for(self, tmp_path, letter, name):
        path = write(tmp_path / "a.tif", imagej=True, metadata={"axes": f"{letter}YX"})
        sentence = sentence_about(path, lambda: read_sequence(path))
        assert f"has the axes {name}, y, x; expected dims with different names, one of them time" in sentence
        np.testing.assert_array_equal(frames_of(path, dims=("time", "y", "x")), FRAMES)


class TestPages:
    @pytest.mark.parametrize("options", [{}, {"compression": "zlib"}, {"compression": "zlib", "metadata": None}])
    def test_written_one_by_one(self, tmp_path, options):
        with tifffile.TiffWriter(tmp_path / "a.tif") as file:
            for frame in FRAMES:
                file.write(frame, **options)
        np.testing.assert_array_equal(frames_of(tmp_path / "a.tif"), FRAMES)
        np.testing.assert_array_equal(read_sequence(tmp_path / "a.tif").read(3, 5), FRAMES[3:5])

    def test_appended(self, tmp_path):
        for frame in FRAMES:
            tifffile.imwrite(tmp_path / "a.tif", frame, append=True)
        np.testing.assert_array_equal(frames_of(tmp_path / "a.tif"), FRAMES)

    def test_written_by_pillow(self, tmp_path):
        first, *others = [Image.fromarray(frame) for frame in FRAMES]
        first.save(tmp_path / "a.tif", save_all=True, append_images=others)
        np.testing.assert_array_equal(frames_of(tmp_path / "a.tif"), FRAMES)

    def test_pages_of_reduced_size_are_left_out(self, tmp_path):
        with tifffile.TiffWriter(tmp_path / "a.tif") as file:
            for frame in FRAMES:
                file.write(frame, contiguous=False)
            file.write(FRAMES[0, ::2, ::2], subfiletype=1)
        sequence = read_sequence(tmp_path / "a.tif")
        np.testing.assert_array_equal(sequence.read(0, 20), FRAMES)
        assert sequence.remarks == ("1 pages of reduced size are left out.",)

    def test_grey_kept_as_colours(self, tmp_path):
        grey = (FRAMES >> 8).astype(np.uint8)
        path = write(tmp_path / "a.tif", np.stack([grey] * 3, -1), photometric="rgb")
        np.testing.assert_array_equal(frames_of(path), grey)


class TestHostile:
    def loop(self, path: Path, place: int) -> None:
        content = bytearray(write(path, photometric="minisblack", metadata=None).read_bytes())
        first = struct.unpack_from("<I", content, 4)[0]
        count = struct.unpack_from("<H", content, first)[0]
        struct.pack_into("<I", content, first + 2 + 12 * count, place or first)
        path.write_bytes(content)

    @pytest.mark.parametrize("place", [0, 2**31])
    def test_directories_that_go_round_or_leave_the_file(self, tmp_path, place):
        self.loop(tmp_path / "a.tif", place)
        assert "its pages go round, lie outside" in sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a.tif"))

    def test_tags_without_end(self, tmp_path):
        content = (
            b"II*\0\x08\0\0\0" + struct.pack("<H", 60_000) + struct.pack("<HHII", 700, 1, 1, 0) * 60_000 + bytes(4)
        )
        (tmp_path / "a.tif").write_bytes(content)
        assert "has 60000 tags" in sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a.tif"))

    def test_a_tag_longer_than_the_file(self, tmp_path):
        content = b"II*\0\x08\0\0\0" + struct.pack("<H", 1) + struct.pack("<HHII", 700, 1, 2**32 - 1, 8) + bytes(4)
        (tmp_path / "a.tif").write_bytes(content)
        assert "a tag is longer than the file" in sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a.tif"))

    def test_an_image_that_no_camera_takes(self, tmp_path):
        Image.new("L", (12_000, 12_000)).save(tmp_path / "frame_0.png")
        assert "is 12000 by 12000; expected at most" in sentence_about(tmp_path, lambda: read_sequence(tmp_path))


def folder_of(path: Path, numbers: list[int], form: str = "frame_{:04d}.png") -> Path:
    path.mkdir()
    for number in numbers:
        Image.fromarray(FRAMES[number % 20]).save(path / form.format(number))
    return path


class TestFolders:
    def test_numbers_are_times(self, tmp_path):
        kept = [3, 4, 5, 9, 10, 17]
        sequence = read_sequence(folder_of(tmp_path / "a", kept), frame_interval=0.04)
        np.testing.assert_allclose(sequence.times, 0.04 * (np.array(kept) - 3), rtol=1e-12)
        np.testing.assert_array_equal(sequence.read(0, 6), FRAMES[kept])
        assert sequence.remarks == ("9 of 15 numbers are missing; frames keep the times of their numbers.",)
        assert read_sequence(tmp_path / "a").times.tolist() == [0, 1, 2, 6, 7, 14]

    def test_numbers_that_go_up_by_ten(self, tmp_path):
        sequence = read_sequence(folder_of(tmp_path / "a", [0, 10, 20, 40]))
        assert sequence.times.tolist() == [0, 1, 2, 4]
        assert sequence.remarks[0] == "Numbers go up by 10; that is taken as one frame."

    def test_numbers_twice(self, tmp_path):
        folder_of(tmp_path / "a", [0, 1, 2])
        Image.fromarray(FRAMES[0]).save(tmp_path / "a" / "frame_01.png")
        assert "holds 2 files with the number 1" in sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a"))

    def test_hidden_files_are_left_out(self, tmp_path):
        folder_of(tmp_path / "a", [0, 1, 2])
        for name in ("._frame_0001.png", ".thumbnail.png"):
            (tmp_path / "a" / name).write_bytes(b"\0\5\26\7mac")
        sequence = read_sequence(tmp_path / "a")
        assert (sequence.length, sequence.remarks) == (3, ("2 hidden files are left out.",))

    def test_times_in_names(self, tmp_path):
        names = ["cam2_20240229T235958.png", "cam2_20240301T000003.png", "cam2_20240301T000001.png"]
        (tmp_path / "a").mkdir()
        for number, name in enumerate(names):
            Image.fromarray(FRAMES[number]).save(tmp_path / "a" / name)
        sequence = read_sequence(tmp_path / "a", start_pattern="%Y%m%dT%H%M%S")
        assert sequence.times.tolist() == [0, 3, 5]
        assert str(sequence.start_time) == "2024-02-29T23:59:58.000000000"
        np.testing.assert_array_equal(sequence.read(0, 3), FRAMES[[0, 2, 1]])

    @pytest.mark.parametrize("kind", ["bmp", "jpg", "jpeg"])
    def test_other_kinds(self, tmp_path, kind):
        (tmp_path / "a").mkdir()
        flat = [np.full((8, 8), 40 * number, np.uint8) for number in range(3)]
        for number, frame in enumerate(flat):
            Image.fromarray(frame).save(tmp_path / "a" / f"{number}.{kind}")
        np.testing.assert_array_equal(frames_of(tmp_path / "a"), flat)
        Image.fromarray(flat[0]).save(tmp_path / "a" / "0.png")
        assert "files; expected one kind" in sentence_about(tmp_path, lambda: read_sequence(tmp_path / "a"))

    def test_grey_kept_as_colours(self, tmp_path):
        (tmp_path / "a").mkdir()
        grey = (FRAMES >> 8).astype(np.uint8)
        for number, frame in enumerate(grey):
            Image.fromarray(np.stack([frame] * 3, -1)).save(tmp_path / "a" / f"{number}.png")
        np.testing.assert_array_equal(frames_of(tmp_path / "a"), grey)


def test_a_pattern_is_for_folders(tmp_path):
    with pytest.raises(InputError, match="start_pattern is for folders of images"):
        read_sequence(write(tmp_path / "a.tif"), start_pattern="%Y")
