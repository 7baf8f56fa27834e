"""Studies on workers: the same bits whoever computes them, nothing lost, nothing computed twice."""

import contextlib
import errno
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from faintrack.errors import InputError
from faintrack.studies import running
from faintrack.studies.folder import Folder, open_folder
from faintrack.studies.running import connect, run_missing
from faintrack.studies.study import HURRIED, Study, compiled_in_a_hurry, repeat, run_batch
from tests.cli.calling import call
from tests.studies.small import WHERE, deadly, study

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with connect(workers=2) as client:
        yield client


@contextlib.contextmanager
def opened(
    path: Path, seed: int | None = None, resume: bool = False, study: Study = study, quick: bool = False
) -> Iterator[Folder]:
    with open_folder(path, study, seed, quick, None, resume) as at:
        yield at


def run_all(client: Any, folder: Folder) -> int:
    return sum(runs for _, runs in run_missing(client, WHERE, folder))


@pytest.fixture(scope="module")
def whole(client: Any, tmp_path_factory: pytest.TempPathFactory) -> dict[str, xr.Dataset]:
    with opened(tmp_path_factory.mktemp("studies") / "whole") as folder:
        assert run_all(client, folder) == 62
        assert not any(folder.missing(setting) for setting in study.settings)
        return {name: folder.results(name) for name in ("short", "long")}


def test_results_are_those_of_the_runs_one_by_one(whole: dict[str, xr.Dataset]) -> None:
    assert whole["short"].place.dims == ("run", "scan")
    assert whole["short"].sizes["run"] == 22
    assert whole["short"].attrs == {"step": 1.0}
    for run in (0, 5, 21):
        again = repeat(WHERE, "short", run)
        np.testing.assert_array_equal(again["place"], whole["short"].place[run])
    assert len(np.unique(whole["short"].farthest)) == 22


def test_a_brief_study_is_compiled_in_a_hurry(client: Any, whole: dict[str, xr.Dataset], tmp_path: Path) -> None:
    """A quick one: the same runs but for rounding, and the same bits again."""
    with opened(tmp_path / "quick", quick=True) as folder:
        run_all(client, folder)
        quick = folder.results("short")
    np.testing.assert_allclose(quick.place, whole["short"].place[: quick.sizes["run"]], rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(repeat(WHERE, "short", 3, quick=True)["place"], quick.place[3])


def test_a_brief_study_needs_no_workers(tmp_path: Path) -> None:
    with opened(tmp_path / "here", quick=True) as folder:
        assert run_all(None, folder) == sum(folder.plan.runs.values())
        assert run_all(None, folder) == 0
        here = folder.results("short").place
    for run in range(here.sizes["run"]):
        np.testing.assert_array_equal(repeat(WHERE, "short", run, quick=True)["place"], here[run])


def test_options_that_the_compiler_does_not_know_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    assert compiled_in_a_hurry() == HURRIED
    compiled_in_a_hurry.cache_clear()
    monkeypatch.setattr("faintrack.studies.study.HURRIED", {"xla_of_another_version": 1})
    assert compiled_in_a_hurry() is None
    compiled_in_a_hurry.cache_clear()


def test_one_worker_gives_the_bits_of_two(whole: dict[str, xr.Dataset], tmp_path: Path) -> None:
    with connect(workers=1) as alone, opened(tmp_path / "alone") as folder:
        run_all(alone, folder)
        for name, expected in whole.items():
            xr.testing.assert_identical(folder.results(name), expected)


def test_a_scheduler_by_its_address(client: Any, whole: dict[str, xr.Dataset], tmp_path: Path) -> None:
    with connect(scheduler=client.scheduler.address) as other, opened(tmp_path / "far", seed=1) as folder:
        run_all(other, folder)
        assert not np.array_equal(folder.results("short").place, whole["short"].place)


def test_an_interrupted_study_goes_on_and_repeats_nothing(
    client: Any, whole: dict[str, xr.Dataset], tmp_path: Path
) -> None:
    path = tmp_path / "cut"
    with opened(path) as folder:
        done = sum(runs for _, runs in itertools.islice(run_missing(client, WHERE, folder), 4))
        part = folder.results("short")
        np.testing.assert_array_equal(part.place, whole["short"].place[: part.sizes["run"]])
    with opened(path, resume=True) as folder:
        assert run_all(client, folder) == 62 - done
        xr.testing.assert_identical(folder.results("long"), whole["long"])
    with opened(path, resume=True) as folder:
        assert run_all(client, folder) == 0


def test_a_full_disk_loses_nothing_that_was_written(
    client: Any, whole: dict[str, xr.Dataset], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, write, count = tmp_path / "full", xr.Dataset.to_zarr, itertools.count()

    def until_full(self: xr.Dataset, *arguments: Any, **options: Any) -> Any:
        if next(count) >= 9:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(self, *arguments, **options)

    with monkeypatch.context() as patch, opened(path) as folder:
        patch.setattr(xr.Dataset, "to_zarr", until_full)
        with pytest.raises(InputError, match=r"full cannot be written \(No space left on device\).*--resume"):
            run_all(client, folder)
    with opened(path, resume=True) as folder:
        assert 0 < run_all(client, folder) < 62
        xr.testing.assert_identical(folder.results("short"), whole["short"])


def test_a_killed_worker_costs_its_batch(client: Any, whole: dict[str, xr.Dataset], tmp_path: Path) -> None:
    with opened(tmp_path / "killed") as folder:
        runs = run_missing(client, WHERE, folder)
        next(runs)
        os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
        for _ in runs:
            pass
        for name, expected in whole.items():
            xr.testing.assert_identical(folder.results(name), expected)


def test_a_batch_that_kills_every_worker_is_named(client: Any, tmp_path: Path) -> None:
    with (
        opened(tmp_path / "deadly", study=deadly) as folder,
        pytest.raises(InputError, match="setting end, runs from 0"),
    ):
        for _ in run_missing(client, "tests.studies.small:deadly", folder):
            pass


def test_a_scheduler_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "PATIENCE", "1s")
    with (
        pytest.raises(InputError, match=r"scheduler tcp://127.0.0.1:1 cannot be reached"),
        connect(scheduler="tcp://127.0.0.1:1"),
    ):
        pass


def test_control_c_keeps_what_is_finished(tmp_path: Path) -> None:
    path = tmp_path / "interrupted"
    # Whoever runs the tests in the background has Ctrl-C ignored, and children inherit that. It is undone in the child
    # itself: `preexec_fn` would fork this process beside JAX's threads.
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    main = f"{listening}; from faintrack.cli import main; main()"
    command = [sys.executable, "-c", main, "study", "run", WHERE, "--workers", "1", "--runs", "4000"]
    process = subprocess.Popen(
        [*command, "--out", str(path)],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    finished = path / "runs.zarr" / "long" / "done" / "0"
    end = time.monotonic() + 60
    while not finished.exists() and time.monotonic() < end:
        time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.strip().splitlines()[-1] == (
        f"faintrack: interrupted; finished runs are kept in {path}, --resume goes on."
    )
    with opened(path, resume=True) as folder:
        place = folder.results("long").place
        np.testing.assert_array_equal(place[:8], run_batch(WHERE, "long", 0, 0)["place"])


def test_command_line_from_runs_to_rows(tmp_path: Path) -> None:
    path = tmp_path / "quick"
    done = call("study", "run", WHERE, "--quick", "--workers", 1, "--out", path, "--json")
    assert done.status == 0, done.err
    summary = json.loads(done.out)
    assert {key: summary[key] for key in ("study", "runs", "seed")} == {
        "study": "small",
        "runs": {"short": 6, "long": 0},
        "seed": 0,
    }
    (row,) = summary["rows"]
    assert row["key"] == "farthest_short"
    assert row["interval"] == [None, None]
    assert row["ours"] == pytest.approx(np.mean([repeat(WHERE, "short", run)["farthest"] for run in range(6)]))
    assert json.loads((path / "rows.json").read_text(encoding="utf-8")) == summary
    assert (path / "figure.png").exists()
    again = call("study", "run", WHERE, "--out", path, "--resume")
    assert again.status == 0
    assert "farthest_short" in again.out


def test_studies_that_come_with_the_package() -> None:
    listed = json.loads(call("study", "list", "--json").out)
    assert "bosser2022" in [entry["study"] for entry in listed["studies"]]


def test_every_setting_has_a_name_of_its_own() -> None:
    from faintrack.studies.bosser2022 import study as full

    names = [setting.name for setting in full.settings]
    assert len(set(names)) == len(names)
