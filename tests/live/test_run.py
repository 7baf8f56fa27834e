"""What a watch leaves: lines, whole results, and a state with which it goes on as if it had never stopped."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import soundfile

import faintrack as ft
from faintrack.kinds.scenario import Scenario
from faintrack.live.keeping import Keeping
from faintrack.live.run import run
from faintrack.live.stream import Piece
from faintrack.live.watch import Watch
from tests.cli.calling import call
from tests.live.streams import FRAME, RATE, pieces, recording, samples, scenario, stream

MOST = 60.0
"""Seconds that a process is given, compilation included."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    soundfile.write(tmp_path / "night.wav", samples(), int(RATE), subtype="FLOAT")
    scenario().save(tmp_path / "scenario.toml")
    return tmp_path


def lines(*texts: str) -> list[dict]:
    return [json.loads(line) for text in texts for line in text.splitlines()]


def kept(watch: Path) -> list[dict]:
    return lines(*(file.read_text() for file in sorted(watch.glob("*.jsonl"))))


def test_lines_say_what_tracks_are(folder: Path) -> None:
    done = call("live", "replay", folder / "night.wav", "--speed", "inf", "--scenario", folder / "scenario.toml")
    assert done.status == 0, done.err
    events = lines(done.out)
    assert [event["event"] for event in events if event["event"] != "remark"] == ["start", *["scan"] * 32, "end"]
    moments = list(ft.follow(recording(), scenario()))
    scans = [event for event in events if event["event"] == "scan"]
    assert [event["time"] for event in scans] == [moment.time for moment in moments]
    for event, moment in zip(scans, moments, strict=True):
        assert [row["label"] for row in event["tracks"]] == [track.label for track in moment.tracks]
        for row, track in zip(event["tracks"], moment.tracks, strict=True):
            assert row["bearing_deg"] == pytest.approx(float(track.mean["bearing"][-1]))
            assert row["bearing_deg_std"] == pytest.approx(float(track.std["bearing"][-1]))
            assert row["existence"] == pytest.approx(float(track.existence[-1]))
    assert scans[-1]["tracks"]


@pytest.mark.slow
def test_a_promise_is_kept_live_too(folder: Path) -> None:
    what, thresholds = scenario(tracker={"targets": 2, "false_tracks": "1/h"}), set()

    def see(watch: Watch, moment: ft.kinds.door.Moment, event: dict) -> None:
        thresholds.add(watch.plan.scenario.tracker.declare)

    run(["replay", str(folder / "night.wav")], what, speed=np.inf, see=see)
    (declare,) = thresholds
    assert declare == pytest.approx(0.7826, abs=1e-4)


def test_what_does_not_fit_is_told_while_it_runs(folder: Path) -> None:
    """With the third of four channels reversed: after each part, as its result has it."""
    reversed_one = samples() * np.array([1, 1, -1, 1], np.float32)
    soundfile.write(folder / "reversed.wav", reversed_one, int(RATE), subtype="FLOAT")
    events: list[dict] = []
    command = ["replay", str(folder / "reversed.wav")]
    run(command, scenario(), out=folder / "watch", speed=np.inf, tell=events.append, part=5.0)
    misfits = [event["text"] for event in events if event["event"] == "misfit"]
    assert all(misfit.startswith("Channel 2 seems to have its poles reversed") for misfit in misfits)
    parts = sorted(path for path in (folder / "watch").iterdir() if path.is_dir() and path.name != "state")
    assert ft.read_result(parts[-1]).misfits == (misfits[-1],)


@pytest.mark.slow
def test_a_watch_that_stops_goes_on_with_the_same_bits(folder: Path) -> None:
    """Stopped after twelve scans and started again: the parts are whole results, and together the run of the file."""
    stop, out, seen = threading.Event(), folder / "watch", []

    def see(watch: object, moment: ft.kinds.door.Moment, event: dict) -> None:
        seen.append(moment.data.existence.values)
        if len(seen) == 12:
            stop.set()

    words = ["replay", str(folder / "night.wav")]
    what = Scenario.read(folder / "scenario.toml")
    assert run(words, what, out=out, speed=np.inf, see=see, stop=stop) == 12
    assert run(words, what, out=out, speed=np.inf, see=see) == 20
    whole = np.concatenate([moment.data.existence.values for moment in ft.follow(recording(), scenario())])
    np.testing.assert_array_equal(np.concatenate(seen), whole)
    first, second = sorted(path for path in out.iterdir() if path.is_dir() and path.name != "state")
    results = [ft.read_result(part) for part in (first, second)]
    np.testing.assert_array_equal(np.concatenate([result.data.existence for result in results]), whole)
    assert (first / "states.csv").exists()
    goes_on = next(event for event in kept(out) if "goes_on" in event)
    assert goes_on["goes_on"] == {"scan": 12, "gap_s": 0.0}
    with pytest.raises(ft.InputError, match="was played to its end before"):
        run(words, what, out=out, speed=np.inf)
    other = scenario(filter={"particles": 70, "births": 30})
    with Keeping(out) as keeping:
        facts = out / "state" / "facts.json"
        facts.write_text(facts.read_text().replace('"scans": 32', '"scans": 20'))
        assert keeping.since().scans == 20
    with pytest.raises(ft.InputError, match="is no state of a run with this scenario"):
        run(words, other, out=out, speed=np.inf)


@pytest.mark.slow
def test_parts_are_as_long_as_is_said(folder: Path) -> None:
    out = folder / "watch"
    run(["replay", str(folder / "night.wav")], scenario(), out=out, speed=np.inf, part=5.0)
    parts = sorted(path for path in out.iterdir() if path.is_dir() and path.name != "state")
    assert sum(ft.read_result(part).data.sizes["time"] for part in parts) == 32
    assert {ft.read_result(part).data.sizes["time"] for part in parts[:-1]} == {11}
    assert [file.stem for file in sorted(out.glob("*.jsonl"))] == [part.name for part in parts]


def started(folder: Path, *source: str) -> subprocess.Popen[str]:
    command = [*("live", *source, "--scenario", "scenario.toml", "--out", "watch")]
    return subprocess.Popen(
        [sys.executable, "-m", "faintrack.cli", *command],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(Path(ft.__file__).parents[1])},
    )


def until(true: object, what: str) -> None:
    for _ in range(round(MOST / 0.1)):
        if true():
            return
        time.sleep(0.1)
    raise AssertionError(what)


def scans(watch: Path) -> list[dict]:
    return [event for event in kept(watch) if event["event"] == "scan"] if watch.exists() else []


def test_a_terminated_watch_is_whole_and_goes_on_with_its_labels(folder: Path) -> None:
    """Raw samples through a pipe, ended by SIGTERM; then again, as a recorder that was away for a while."""
    options = ("-", "--channels", "4", "--rate", "1000")
    watch = folder / "watch"
    process = started(folder, *options)
    process.stdin.write(samples()[:13_000].tobytes())
    process.stdin.flush()
    until(lambda: scans(watch), "no scan")
    begun = time.monotonic()
    until(lambda: len(scans(watch)) >= 25, "no scans")
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=MOST)
    assert process.returncode == 0, err
    (part,) = (path for path in watch.iterdir() if path.is_dir() and path.name != "state")
    first = ft.read_result(part)
    assert first.data.sizes["time"] == 25
    assert not list(watch.glob(".*partial"))
    (label,) = {track.label for track in first.tracks}
    # Samples came faster than a recorder's: what is away begins when their time has passed on the clock too.
    until(lambda: time.monotonic() - begun > 26 * FRAME, "no time")
    again = started(folder, *options)
    again.stdin.write(samples()[8_000:].tobytes())
    again.stdin.close()
    again.stdin = None
    _, err = again.communicate(timeout=MOST)
    assert again.returncode == 0, err
    start = [event for event in kept(watch) if event["event"] == "start"][-1]
    assert start["goes_on"]["scan"] == 25
    assert 0 < start["goes_on"]["gap_s"] < 2 * MOST
    later = scans(watch)[25:]
    assert {row["label"] for event in later for row in event["tracks"]} == {label}
    assert later[0]["time"] == (25 + 0.5) * FRAME + start["goes_on"]["gap_s"]


def test_a_watch_that_was_killed_goes_on_from_its_last_state(folder: Path) -> None:
    """No code runs at its end: the state is at most a minute old, and the scans since are taken in again."""
    watch = folder / "watch"
    process = started(folder, "replay", "night.wav", "--speed", "4")
    until(lambda: len(scans(watch)) >= 10, "no scans")
    process.kill()
    process.communicate(timeout=MOST)
    assert list(watch.glob(".*partial"))
    run(["replay", str(folder / "night.wav")], scenario(), out=watch, speed=np.inf)
    whole = [moment.existence for moment in ft.follow(recording(), scenario())]
    # Of a scan that was taken in twice the later line counts; digits are those of single precision.
    found = {event["scan"]: event["existence"] for event in scans(watch)}
    assert [found[number] for number in range(32)] == pytest.approx(whole, rel=1e-8)
    assert not list(watch.glob(".*partial"))
    with Keeping(watch) as keeping:
        assert keeping.since().scans == 32


def test_what_a_killed_run_has_written_is_made_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its store as it was after a flush."""
    watch = tmp_path / "watch"
    kept_aside = tmp_path / "aside"

    def see(running: object, moment: object, event: dict) -> None:
        if event["scan"] == 31:
            (partial,) = watch.glob(".*partial")
            shutil.copytree(partial, kept_aside / partial.name)

    monkeypatch.setattr("faintrack.results.folder.CHUNK", 4)
    soundfile.write(tmp_path / "night.wav", samples(), int(RATE), subtype="FLOAT")
    run(["replay", str(tmp_path / "night.wav")], scenario(), out=watch, speed=np.inf, see=see)
    (part,) = (path for path in watch.iterdir() if path.is_dir() and path.name != "state")
    shutil.rmtree(part)
    (left,) = kept_aside.iterdir()
    shutil.move(left, watch / left.name)
    with Keeping(watch):
        result = ft.read_result(part)
    assert result.data.sizes["time"] == 28
    assert result.remarks[0].startswith("The run was killed")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere.wav",), "nowhere.wav does not exist; expected - (standard input), a named pipe"),
        (("udp://here",), "udp://here is no address; expected udp://ADDRESS:PORT"),
        (("udp://127.0.0.1:99999",), "udp://127.0.0.1:99999 is no address"),
        (("replay",), "replay needs a file"),
        (("replay", "nowhere.wav"), "nowhere.wav does not exist"),
        (("replay", "night.wav", "--speed", "0"), "--speed is of replay FILE, and a number above 0"),
        (("night.wav", "--speed", "2"), "--speed is of replay FILE"),
        (("-", "--channels", "4"), "raw samples need --channels and --rate, both"),
        (("night.wav", "--channels", "4", "--rate", "1000", "--format", "int8"), "--format is int8; expected"),
        (("night.wav", "--channels", "0", "--rate", "1000"), "--channels is 0; expected 1 or more"),
        (("night.wav", "--channels", "4", "--rate", "nan"), "the sample rate is nan"),
        (("scenario.toml",), "scenario.toml does not begin as a WAV file"),
        ((".",), ". is a folder or a device"),
        (("night.wav", "more.wav"), "there are 2 sources; expected one"),
        (("replay", "night.wav", "--out", "night.wav"), "night.wav is no folder"),
        (("replay", "night.wav", "--out", "."), ". exists and is no folder of faintrack live"),
        (("replay", "two.wav", "--speed", "inf"), "two.wav has 2 channels; the array has 4"),
    ],
)
def test_bad_input_is_one_sentence(
    arguments: tuple[str, ...], said: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    soundfile.write("two.wav", samples()[:3000, :2], int(RATE))
    done = call("live", *arguments, "--scenario", "scenario.toml")
    assert (done.status, done.out) == (2, "")
    assert done.err.startswith("faintrack: "), done.err
    assert said in done.err
    assert done.err.count("\n") == 1


@pytest.mark.slow
def test_a_stream_without_a_frame_is_told(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    for name, count in (("none.raw", 0), ("short.raw", 300)):
        (folder / name).write_bytes(samples()[:count].tobytes())
        with (folder / name).open("rb") as file:
            done = subprocess.run(
                [
                    sys.executable,
                    "-m",
                    "faintrack.cli",
                    "live",
                    "-",
                    "--channels",
                    "4",
                    "--rate",
                    "1000",
                    "--scenario",
                    "scenario.toml",
                ],
                stdin=file,
                capture_output=True,
                text=True,
                env=os.environ | {"PYTHONPATH": str(Path(ft.__file__).parents[1])},
                check=False,
            )
        assert done.returncode == 2, done.stderr
        assert done.stderr.splitlines()[-1] == ("faintrack: standard input ended before one frame of 0.5 s had come.")


def test_a_source_that_breaks_ends_the_watch_with_its_reason_and_a_whole_result(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken() -> Iterator[Piece]:
        yield from pieces(samples()[:14_000])
        raise OSError("the cable is out")

    monkeypatch.setattr("faintrack.live.watch.opened_stream", lambda *arguments: stream(broken()))
    with pytest.raises(ft.InputError, match=r"^test broke \(the cable is out\)\.$"):
        run(["-"], scenario(), out=folder / "watch")
    with Keeping(folder / "watch") as keeping:
        assert keeping.since().scans == 27


def test_a_full_disk_is_one_sentence(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(event: object) -> str:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("faintrack.live.keeping.line", full)
    with pytest.raises(ft.InputError, match=r"watch cannot be written \(No space left on device\)"):
        run(["replay", str(folder / "night.wav")], scenario(), out=folder / "watch", speed=np.inf)


def test_an_array_is_needed(folder: Path) -> None:
    done = call("live", "replay", folder / "night.wav")
    assert done.status == 2
    assert "no array was given" in done.err


def test_one_process_at_a_time(tmp_path: Path) -> None:
    with Keeping(tmp_path / "watch"), pytest.raises(ft.InputError, match="is being written by another run"):
        Keeping(tmp_path / "watch").__enter__()
