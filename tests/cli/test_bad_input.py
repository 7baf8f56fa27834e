"""Bad input: one sentence that names file and field, exit status 2, nothing half written."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import soundfile

from tests.cli.calling import SCENARIO, call

LINE = "sound_speed = 1500.0\nline = {count = 4, spacing = 0.5}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder with a good recording and a good array."""
    (tmp_path / "array.toml").write_text(LINE)
    write_wav(tmp_path / "good.wav", np.random.default_rng(0).normal(size=(4000, 4)))
    return tmp_path


def write_wav(path: Path, samples: np.ndarray, rate: int = 1000) -> None:
    soundfile.write(path, samples.astype(np.float32), rate, subtype="FLOAT")


def refuse(folder: Path, *arguments: object, names: tuple[str, ...]) -> None:
    """The call fails with one sentence that holds these names, and writes nothing."""
    before = sorted(folder.rglob("*"))
    done = call(*arguments, "--out", folder / "out")
    assert done.status == 2, done
    assert done.out == ""
    (line,) = done.err.strip().splitlines()
    assert line.startswith("faintrack: ")
    assert line.endswith((".", "?"))
    for name in names:
        assert name in line, line
    assert sorted(folder.rglob("*")) == before


def refuse_track(folder: Path, recording: str, *options: object, names: tuple[str, ...]) -> None:
    refuse(folder, "track", folder / recording, "--array", folder / "array.toml", *options, names=names)


def test_missing_recording(folder: Path) -> None:
    refuse_track(folder, "none.wav", names=("none.wav",))


def test_empty_recording(folder: Path) -> None:
    (folder / "empty.wav").touch()
    refuse_track(folder, "empty.wav", names=("empty.wav", "empty"))


def test_truncated_recording(folder: Path) -> None:
    whole = (folder / "good.wav").read_bytes()
    (folder / "cut.wav").write_bytes(whole[: len(whole) // 2])
    refuse_track(folder, "cut.wav", names=("cut.wav",))


def test_no_recording_at_all(folder: Path) -> None:
    (folder / "text.wav").write_text("not a sound")
    refuse_track(folder, "text.wav", names=("text.wav",))


def test_wrong_channel_count(folder: Path) -> None:
    write_wav(folder / "three.wav", np.ones((4000, 3)))
    refuse_track(folder, "three.wav", names=("three.wav", "3 channels", "has 4"))


@pytest.mark.slow
def test_channel_that_is_never_finite(folder: Path) -> None:
    samples = np.random.default_rng(0).normal(size=(4000, 4))
    samples[:, 2] = np.nan
    write_wav(folder / "nan.wav", samples)
    done = call("track", folder / "nan.wav", "--array", folder / "array.toml")
    assert done.status == 0, done.err
    assert "Channel 2: 4000 samples from 0 s to 4 s are missing (not finite)." in done.out
    samples[:, 1:] = np.nan
    write_wav(folder / "nan.wav", samples)
    refuse_track(folder, "nan.wav", names=("nan.wav", "channels 1, 2, 3", "two"))


def test_recordings_of_different_rate(folder: Path) -> None:
    write_wav(folder / "slow.wav", np.ones((4000, 2)), rate=500)
    refuse(
        folder,
        *("track", folder / "good.wav", folder / "slow.wav", "--array", folder / "array.toml"),
        names=("slow.wav", "500", "1000"),
    )


def test_rate_of_zero(folder: Path) -> None:
    with h5py.File(folder / "zero.h5", "w") as file:
        file["time_data"] = np.ones((4000, 4), np.float32)
        file["time_data"].attrs["sample_freq"] = 0.0
    refuse_track(folder, "zero.h5", names=("zero.h5", "sample rate"))


def test_band_beyond_nyquist(folder: Path) -> None:
    refuse_track(folder, "good.wav", "--band", 100, 900, names=("good.wav", "band", "500"))


def test_band_upside_down(folder: Path) -> None:
    refuse_track(folder, "good.wav", "--band", 300, 100, names=("good.wav", "band"))


def test_band_between_two_bins(folder: Path) -> None:
    refuse_track(folder, "good.wav", "--band", 100.1, 100.2, names=("good.wav", "band", "bin"))


def test_frame_longer_than_the_recording(folder: Path) -> None:
    refuse_track(folder, "good.wav", "--frame", 60, names=("good.wav", "4 s", "60 s"))


@pytest.mark.parametrize("frame", [0, -1, "nan"])
def test_frame_that_is_no_length(folder: Path, frame: object) -> None:
    refuse_track(folder, "good.wav", "--frame", frame, names=("frame",))


def test_no_array(folder: Path) -> None:
    refuse(folder, "track", folder / "good.wav", names=("--array",))


def test_array_with_duplicate_positions(folder: Path) -> None:
    (folder / "array.toml").write_text(
        'channels = [{name = "a", x = 0, y = 0}, {name = "b", x = 1, y = 0}, {name = "c", x = 0, y = 0}]'
    )
    refuse_track(folder, "good.wav", names=("array.toml", "a and c", "position"))


def test_array_with_unknown_field(folder: Path) -> None:
    (folder / "array.toml").write_text(LINE + "speed = 1500.0\n")
    refuse_track(folder, "good.wav", names=("array.toml", "speed"))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("[analysis]\nframes = 1.0\n", ("analysis.frames",)),
        ("[tracker]\ndeclare = 1.5\n", ("tracker.declare", "1.5")),
        ("[tracker]\ndeclare = 0.2\n", ("drop", "declare")),
        ('[likelihood]\nkind = "known_noise"\n', ("noise_power", "noise_seconds")),
        ("[target]\nsnr_db = [0.0, -10.0]\n", ("snr_db",)),
        ("[analysis\n", ("TOML",)),
    ],
)
def test_scenario_that_is_wrong(folder: Path, text: str, names: tuple[str, ...]) -> None:
    (folder / "scenario.toml").write_text(text)
    refuse_track(folder, "good.wav", "--scenario", folder / "scenario.toml", names=("scenario.toml", *names))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ('[frames]\ndims = ["time", "y"]\n', ("frames.npz", "(6, 9, 9)", "time, y")),
        ('[frames]\ndims = ["x", "time", "bearing"]\n', ("frames.npz", "x, bearing", "y and x")),
        ('[frames]\nvariable = "power"\n', ("frames.npz", "power", "frames")),
        ('[frames]\nvariable = "four"\n', ("frames.npz", "four", "(2, 3, 4, 5)", "dims")),
        ("[frames]\nframe_interval = 0.0\n", ("scenario.toml", "frames.frame_interval", "0")),
        ("[frames]\nrate = 1.0\n", ("scenario.toml", "no field frames.rate")),
        ("[frames]\n[cells]\nlevels = []\n", ("scenario.toml", "cells.levels")),
        ('[frames]\n[cells]\namplitude = "rice"\n', ("scenario.toml", "cells.amplitude", "rice")),
        ('[frames]\nbackground = "none"\n', ("frames.npz", "cells.amplitude is missing")),
        ('[frames]\n[tracker]\nmethod = "cfar"\n', ("scenario.toml", "no field tracker.method", "declare, drop")),
        ("[frames]\n[array]\n" + LINE, ("scenario.toml", "[frames]", "[array]")),
        ("[frames]\n[analysis]\nframe = 2.0\n", ("scenario.toml", "[frames]", "[analysis]")),
        ("frames = 3\n", ("scenario.toml", "frames is 3", "expected a table")),
        ('[frames]\ndims = "time"\n', ("scenario.toml", "frames.dims", "expected a list")),
        ("[filter]\nguided = true\n", ("scenario.toml", "filter.guided", "frames.npz was taken for frames", "--kind")),
    ],
)
def test_frames_that_do_not_fit_the_scenario(folder: Path, text: str, names: tuple[str, ...]) -> None:
    np.savez(folder / "frames.npz", frames=np.ones((6, 9, 9)), four=np.ones((2, 3, 4, 5)))
    if "variable" not in text:
        np.savez(folder / "frames.npz", frames=np.ones((6, 9, 9)))
    (folder / "scenario.toml").write_text(text)
    refuse(folder, "track", folder / "frames.npz", "--scenario", folder / "scenario.toml", names=names)


def test_frames_that_are_not_there(folder: Path) -> None:
    (folder / "empty").mkdir()
    refuse(folder, "track", folder / "none", names=("none does not exist",))
    refuse(folder, "track", folder / "empty", names=("empty holds no PNG file",))


def test_frames_with_what_only_an_array_has(folder: Path) -> None:
    np.savez(folder / "frames.npz", frames=np.ones((6, 9, 9)))
    (folder / "scenario.toml").write_text("[frames]\n")
    options = ("--scenario", folder / "scenario.toml", "--band", 100, 200)
    refuse(folder, "track", folder / "frames.npz", *options, names=("scenario.toml", "[frames]", "[analysis]"))
    two = ("track", folder / "frames.npz", folder / "frames.npz")
    refuse(folder, *two, "--kind", "frames", names=("2 files", "one file"))
    refuse(folder, *two, names=("frames.npz", "--kind"))


def test_recording_with_a_scenario_for_frames(folder: Path) -> None:
    (folder / "scenario.toml").write_text("[frames]\n")
    refuse(
        folder,
        *("track", folder / "good.wav", "--scenario", folder / "scenario.toml"),
        names=("good.wav", "holds recording", "frames"),
    )


def test_guard_that_does_not_fit_the_beams(folder: Path) -> None:
    (folder / "scenario.toml").write_text("[cfar]\nguard = 500\n")
    options = ("--scenario", folder / "scenario.toml", "--method", "cfar")
    refuse_track(folder, "good.wav", *options, names=("good.wav", "CFAR guard 500", "beams"))


@pytest.mark.parametrize(
    ("setting", "names"),
    [
        ("tracker.declare", ("--set tracker.declare", "SECTION.FIELD=VALUE")),
        ("declare=0.9", ("--set declare=0.9", "SECTION.FIELD=VALUE")),
        ("tracker.declare=high", ("tracker.declare is 'high'", "number")),
        ("tracker.declared=0.9", ("no field tracker.declared", "declare")),
    ],
)
def test_setting_that_is_none(folder: Path, setting: str, names: tuple[str, ...]) -> None:
    refuse_track(folder, "good.wav", "--set", setting, names=names)


def test_kind_that_is_none(folder: Path) -> None:
    refuse_track(folder, "good.wav", "--kind", "film", names=("kind is 'film'", "recording, frames"))
    done = call("init", "film")
    assert done.status == 2
    assert "kind is 'film'; expected one of recording, frames" in done.err


def test_init_leaves_what_is_there_alone(folder: Path) -> None:
    (folder / "scenario.toml").write_text("mine")
    done = call("init", "frames", "--out", folder / "scenario.toml")
    assert done.status == 2
    assert "scenario.toml exists" in done.err
    assert (folder / "scenario.toml").read_text() == "mine"
    assert call("init", "frames", "--out", folder / "own.toml").status == 0
    assert call("init", "frames").out == (folder / "own.toml").read_text()


def test_scenario_that_is_missing(folder: Path) -> None:
    refuse_track(folder, "good.wav", "--scenario", folder / "none.toml", names=("none.toml",))


def test_output_below_a_file(folder: Path) -> None:
    done = call("track", folder / "good.wav", "--array", folder / "array.toml", "--out", folder / "good.wav" / "out")
    assert done.status == 2
    assert "out cannot be written" in done.err


def test_output_that_is_no_result_is_left_alone(folder: Path) -> None:
    (folder / "mine").mkdir()
    (folder / "mine" / "letter.txt").write_text("keep me")
    done = call("track", folder / "good.wav", "--array", folder / "array.toml", "--out", folder / "mine")
    assert done.status == 2
    assert "mine exists and is no result" in done.err
    assert (folder / "mine" / "letter.txt").read_text() == "keep me"


@pytest.mark.parametrize("what", ["nothing", "empty folder", "damaged"])
def test_report_of_no_result(folder: Path, what: str) -> None:
    result = folder / "result"
    if what != "nothing":
        result.mkdir()
    if what == "damaged":
        assert call("track", folder / "good.wav", "--array", folder / "array.toml", "--out", folder / "r").status == 0
        (folder / "r").rename(folder / "result2")
        result = folder / "result2"
        (result / "result.zarr" / ".zmetadata").write_text("{")
    done = call("report", result)
    assert done.status == 2
    assert str(result) in done.err
    assert not (result / "report.html.partial").exists()


def test_simulation_without_a_simulation(folder: Path) -> None:
    (folder / "scenario.toml").write_text("[array]\n" + LINE)
    done = call("simulate", folder / "scenario.toml", "--out", folder / "out.h5")
    assert done.status == 2
    assert "[simulation]" in done.err
    assert not (folder / "out.h5").exists()


def test_simulation_to_an_unknown_kind_of_file(folder: Path) -> None:
    (folder / "scenario.toml").write_text(SCENARIO)
    done = call("simulate", folder / "scenario.toml", "--out", folder / "out.mp3")
    assert done.status == 2
    assert "out.mp3" in done.err


def test_samples_that_are_not_finite_are_masked_and_counted(folder: Path) -> None:
    samples = np.random.default_rng(0).normal(size=(8000, 4))
    samples[2500, 1] = np.nan
    samples[5500, 3] = np.inf
    write_wav(folder / "holes.wav", samples)
    done = call("track", folder / "holes.wav", "--array", folder / "array.toml")
    assert done.status == 0, done.err
    assert "0 tracks in 8 scans, 2 masked scans" in done.out
