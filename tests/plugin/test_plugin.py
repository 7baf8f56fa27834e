"""Stone Soup finds the plug-in by its entry point; without Stone Soup one sentence says what is missing."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def python(program: str, *paths: Path) -> "subprocess.CompletedProcess[str]":
    path = os.pathsep.join(map(str, (*paths, ROOT / "src")))
    return subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True
    )


def test_stonesoup_finds_the_plugin_of_an_installation(tmp_path: Path) -> None:
    pytest.importorskip("stonesoup")
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    # What an installer makes of the table.
    installed = tmp_path / "faintrack-9.9.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: faintrack\nVersion: 9.9\n", encoding="utf-8")
    lines = [f"[{group}]\n{name} = {place}\n" for group, all_of in groups.items() for name, place in all_of.items()]
    (installed / "entry_points.txt").write_text("".join(lines), encoding="utf-8")
    program = """
import stonesoup.plugins
from stonesoup.plugins.faintrack import BearingsReader, ReturnsReader, ScenarioTracker, bearings_of
from stonesoup.reader import DetectionReader
from stonesoup.tracker import Tracker
print(issubclass(ScenarioTracker, Tracker), issubclass(BearingsReader, DetectionReader))
"""
    done = python(program, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["True", "True"]


def test_without_stonesoup_one_sentence_says_so() -> None:
    program = "import sys; sys.modules['stonesoup'] = None; import faintrack.stonesoup"
    done = python(program)
    assert done.stderr.splitlines()[-1] == (
        'ImportError: faintrack.stonesoup needs Stone Soup, which is not installed: pip install "faintrack[stonesoup]".'
    )
