"""However a call ends, what was there before is whole, and what is said is one line."""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import soundfile

import faintrack as ft
from faintrack.cli.app import app
from faintrack.io.locks import locked
from tests.cli.calling import call

ARRAY = "sound_speed = 1500.0\nline = {count = 4, spacing = 0.5}\n"
OPTIONS = ("--set", "analysis.frame=0.1", "--set", "filter.particles=60", "--set", "filter.births=30")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder with a recording of a minute and its array; blanks, umlauts and signs of formulas in the names."""
    folder = tmp_path / "a$x^$b Über see"
    folder.mkdir()
    noise = np.random.default_rng(0).normal(size=(60_000, 4)) / 8
    soundfile.write(folder / "nächt 1.wav", noise, 1000, subtype="FLOAT")
    (folder / "array.toml").write_text(ARRAY, encoding="utf-8")
    return folder


def arguments(folder: Path, out: Path) -> list[str]:
    return [*("track", str(folder / "nächt 1.wav"), "--array", str(folder / "array.toml"), "--out", str(out)), *OPTIONS]


def started(*command: str, limit: int | None = None) -> subprocess.Popen[str]:
    def limited() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    return subprocess.Popen(
        [sys.executable, "-m", "faintrack.cli", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=limited,
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def kept(folder: Path) -> Path:
    """A result that was there before, and a file of the user's beside it."""
    out = folder / "out"
    done = call(*arguments(folder, out))
    assert done.status == 0, done.err
    (out / "mynotes.txt").write_text("keep me", encoding="utf-8")
    return out


def test_names_of_all_kinds_and_a_second_run(folder: Path, kept: Path) -> None:
    assert "data:image/png" in (kept / "report.html").read_text(encoding="utf-8")
    again = call(*arguments(folder, kept))
    assert again.status == 0, again.err
    assert (kept / "mynotes.txt").read_text(encoding="utf-8") == "keep me"
    assert ft.read_result(kept).data.sizes["time"] == 600


@pytest.mark.slow
def test_signals_at_any_moment(folder: Path, kept: Path) -> None:
    """One line, status 130 or 143, nothing half written; a run that was faster than the signal is whole."""
    before, beside = contents(kept), sorted(path.name for path in folder.iterdir())
    moments = random.Random(1)
    for number, moment in ((n, moments.uniform(0.3, 6.0)) for n in (signal.SIGINT, signal.SIGTERM) * 3):
        process = started(*arguments(folder, kept))
        time.sleep(moment)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
        if process.returncode == 0:
            before = contents(kept)
            continue
        assert process.returncode == {signal.SIGINT: 130, signal.SIGTERM: 143}[number], (moment, err)
        assert err.strip().splitlines() == ["faintrack: interrupted; no result was written."], (moment, out)
        assert contents(kept) == before
        assert [path.name for path in sorted(folder.iterdir()) if path.suffix != ".lock"] == [
            name for name in beside if not name.endswith(".lock")
        ]


@pytest.mark.slow
def test_killed_at_any_moment(folder: Path, kept: Path) -> None:
    """What was there is whole, or what was to be; what is left over goes with the next run."""
    before = contents(kept)
    moments = random.Random(2)
    for _ in range(3):
        process = started(*arguments(folder, kept))
        time.sleep(moments.uniform(2.0, 7.0))
        process.kill()
        process.communicate()
        if process.returncode != 0:
            assert contents(kept) == before
        assert ft.read_result(kept).data.sizes["time"] == 600
    assert call(*arguments(folder, kept)).status == 0
    assert not [path.name for path in folder.iterdir() if path.name.endswith((".partial", ".older"))]


def test_a_second_run_to_the_same_folder_is_refused(folder: Path) -> None:
    out = folder / "out"
    with locked(out.with_name(f".{out.name}.lock")):
        done = call(*arguments(folder, out))
    assert done.status == 2
    assert done.err == f"faintrack: {out} is being written by another run; expected another name for --out.\n"
    assert not out.exists()


@pytest.mark.slow
def test_no_room_on_the_disk(folder: Path, kept: Path) -> None:
    before = contents(kept)
    process = started(*arguments(folder, kept), limit=2000)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 2, err
    (line,) = err.strip().splitlines()
    assert line.startswith(f"faintrack: {kept} cannot be written (")
    assert contents(kept) == before


def test_a_link_is_no_folder(folder: Path) -> None:
    (folder / "real").mkdir()
    (folder / "link").symlink_to(folder / "real")
    done = call(*arguments(folder, folder / "link"))
    assert done.err == f"faintrack: {folder / 'link'} is a link; expected the folder itself for --out.\n"
    assert not list((folder / "real").iterdir())


@pytest.mark.parametrize("out", ["none/out", "closed/out"])
def test_a_place_that_cannot_be_written_is_refused_before_the_run(folder: Path, out: str) -> None:
    (folder / "closed").mkdir(mode=0o555)
    if out.startswith("closed") and os.access(folder / "closed", os.W_OK):
        pytest.skip("the superuser may write everywhere")
    done = call(*arguments(folder, folder / out))
    assert (done.status, done.out) == (2, "")
    assert f"{folder / out} cannot be written: " in done.err


def test_a_reader_that_closes_the_pipe(folder: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "faintrack.cli", "init", "recording"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait(timeout=60) == 1


def test_help_keeps_its_brackets() -> None:
    """What stands in brackets is markup unless it is escaped; only the markup that is meant may vanish."""
    from rich.text import Text

    texts = [command.callback.__doc__ or "" for command in app.registered_commands if command.callback]
    assert any("[bold]" in text for text in texts)
    for command in ("simulate", "track", "info", "init", "calibrate", "report"):
        shown = call(command, "--help").out
        assert "[bold]" not in shown
    assert "[simulation]" in call("simulate", "--help").out
    assert Text.from_markup(r"\[simulation]").plain == "[simulation]"
