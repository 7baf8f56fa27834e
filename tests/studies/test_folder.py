"""Folders that are not what is asked for: one sentence that says what was found, and nothing touched."""

import importlib.util
import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.io import locks
from faintrack.studies.folder import open_folder
from faintrack.studies.study import load, run_batch
from tests.studies.small import WHERE, other, study

DAMAGED = json.dumps({"format": 1, "version": "0", "study": "small", "seed": 0, "quick": False, "runs": {"short": "x"}})


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Folder of a study with one batch."""
    with open_folder(tmp_path / "out", study, None, False, None, resume=False) as folder:
        folder.write(study.settings[0], 4, run_batch(WHERE, "short", 0, 4))
    return tmp_path / "out"


def change(path: Path, **fields: object) -> None:
    file = path / "study.json"
    file.write_text(json.dumps(json.loads(file.read_text(encoding="utf-8")) | fields), encoding="utf-8")


def refuse(path: Path, says: str, which: object = study, resume: bool = True, **asked: object) -> None:
    options = {"seed": None, "quick": False, "runs": None} | asked
    before = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
    with pytest.raises(InputError, match=says), open_folder(path, which, resume=resume, **options):  # type: ignore[arg-type]
        pass
    assert {file: file.read_bytes() for file in path.rglob("*") if file.is_file()} == before


def test_only_finished_runs_are_read(path: Path) -> None:
    with open_folder(path, study, None, False, None, resume=True) as folder:
        assert folder.missing(study.settings[0]) == [0, 8, 12, 16, 20]
        np.testing.assert_array_equal(folder.results("short").place, run_batch(WHERE, "short", 0, 4)["place"])
        with pytest.raises(InputError, match="no run of setting long"):
            folder.results("long")


def test_more_runs_are_added_to_those_there_are(tmp_path: Path) -> None:
    """The batch that was cut short is computed again, whole ones are not, and the runs are those of one long study."""
    short = study.settings[0]
    with open_folder(tmp_path, study, None, False, 6, resume=False) as folder:
        for first in (0, 4):
            folder.write(short, first, run_batch(WHERE, "short", 0, first))
        assert folder.missing(short) == []
    with open_folder(tmp_path, study, None, False, 10, resume=True) as folder:
        assert folder.plan.runs == {"short": 10, "long": 10}
        assert folder.results("short").sizes["run"] == 6
        assert folder.missing(short) == [4, 8]
        for first in (4, 8):
            folder.write(short, first, run_batch(WHERE, "short", 0, first))
    with open_folder(tmp_path, study, None, False, None, resume=True) as folder:
        assert folder.missing(short) == []
        expected = np.concatenate([run_batch(WHERE, "short", 0, first)["place"] for first in (0, 4, 8)])
        np.testing.assert_array_equal(folder.results("short").place, expected[:10])
    refuse(tmp_path, "9 of each were asked for, expected no fewer", runs=9)


def test_a_study_is_not_written_over(path: Path) -> None:
    refuse(path, "holds a study; add --resume", resume=False)


def test_folder_of_another_study(path: Path) -> None:
    refuse(path, "study.json is of study small; expected other", other)


def test_folder_of_an_older_version(path: Path) -> None:
    change(path, version="0.0.1")
    refuse(path, "is of faintrack 0.0.1, format 1; this is")


def test_folder_of_an_older_format(path: Path) -> None:
    change(path, format=0)
    refuse(path, "format 0; this is")


def test_folder_of_other_settings(path: Path) -> None:
    change(path, runs={"short": 3})
    refuse(path, "settings are not those of the study now")


def test_another_seed_or_number_of_runs(path: Path) -> None:
    refuse(path, "the study has seed 0; 7 was asked for", seed=7)
    refuse(path, "3 of each were asked for", runs=3)
    refuse(path, "a full one; a quick one was asked for", quick=True)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", "null", DAMAGED])
def test_a_description_that_is_damaged(path: Path, text: str) -> None:
    (path / "study.json").write_text(text, encoding="utf-8")
    refuse(path, "study.json cannot be read")


def test_a_folder_of_something_else(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with (
        pytest.raises(InputError, match=r"holds thesis.tex and no study.json"),
        open_folder(tmp_path, study, None, False, None, resume=False),
    ):
        pass
    assert [entry.name for entry in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("file", ["place/1.0", "farthest/1", "done/1", "done/.zarray"])
@pytest.mark.parametrize("content", [b"", b"{", b"garbage" * 30])
def test_runs_that_are_damaged(path: Path, file: str, content: bytes) -> None:
    (path / "runs.zarr" / "short" / file).write_bytes(content)
    with open_folder(path, study, None, False, None, resume=True) as folder:
        read = folder.missing if file.startswith("done") else lambda setting: folder.results(setting.name)
        with pytest.raises(InputError, match="short is damaged; delete it and run again with --resume"):
            read(study.settings[0])


@pytest.mark.parametrize("file", ["place/.zarray", ".zgroup"])
def test_no_runs_are_added_to_damaged_ones(path: Path, file: str) -> None:
    (path / "runs.zarr" / "short" / file).write_text("garbage", encoding="utf-8")
    refuse(path, "short is damaged; delete it and run again with --resume", runs=60)


def test_a_file_in_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with (
        pytest.raises(InputError, match="out cannot be written"),
        open_folder(tmp_path / "out", study, None, False, None, resume=False),
    ):
        pass


def test_two_studies_on_one_folder(path: Path) -> None:
    with open_folder(path, study, None, False, None, resume=True):
        refuse(path, "in use by another study")


def test_the_lock_of_windows(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The module is read again as it is on Windows, where there is no fcntl; what it asks of the system is noted."""
    locked: list[tuple[int, int]] = []

    def locking(file: int, mode: int, count: int) -> None:
        if locked:
            raise OSError("in use")
        locked.append((mode, count))

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "fcntl", None)  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(LK_NBLCK=2, locking=locking))  # type: ignore[arg-type]
    specification = importlib.util.spec_from_file_location("locks_of_windows", locks.__file__)
    module = importlib.util.module_from_spec(specification)
    monkeypatch.setitem(sys.modules, "locks_of_windows", module)
    specification.loader.exec_module(module)
    with module.locked(path / "lock"):
        assert locked == [(2, 1)]
        with pytest.raises(module.Held), module.locked(path / "lock"):
            pass


@pytest.mark.parametrize("parameters", [{"step": 1.5}, {}, {"step": 1.0, "stride": 2.0}])
def test_runs_with_other_parameters(path: Path, parameters: dict[str, float]) -> None:
    short, *others = study.settings
    changed = replace(study, settings=(replace(short, parameters=parameters), *others))
    with open_folder(path, changed, None, False, None, resume=True) as at:
        for read in (at.missing, lambda setting: at.results(setting.name)):
            with pytest.raises(InputError, match=r"short has runs with (step = 1.0|stride = None); it is .* now"):
                read(changed.settings[0])


def test_a_study_that_does_not_exist() -> None:
    for where in ("nothing", "no.such.module:study", "tests.studies.small:nothing", "tests.studies.small:rows"):
        with pytest.raises(InputError, match=where):
            load(where)


def test_a_study_in_the_folder_one_stands_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "walks_here.py").write_text("from tests.studies.small import study\n", encoding="utf-8")
    monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry])
    monkeypatch.chdir(tmp_path)
    assert load("walks_here:study").name == "small"


def test_a_setting_that_does_not_exist() -> None:
    with pytest.raises(InputError, match="no setting middle; expected one of short, long"):
        study.setting("middle")
