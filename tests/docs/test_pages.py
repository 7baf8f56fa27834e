"""What the pages show runs: Python is executed, commands are called, TOML is read.

A page's blocks run in their order in one folder that holds `night.wav` and `array.toml`. A `toml` block is written to
the file that its first line names, and so is a `python` block whose first line names one: a module that later blocks
import. What cannot run here is `bash`, `text`, or a `code-block` directive.
"""

import doctest
import re
import shlex
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from typer.testing import CliRunner

from faintrack import Scenario, kinds, read_array
from faintrack.cli.app import app
from faintrack.io import write_recording

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in PAGES if not {"_build", "gallery"} & set(page.relative_to(ROOT).parts)]
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LONG = {
    "track_contacts",
    "truth",
    "array_file",
    "export",
    "live",
    "tones",
    "track_active_sonar",
    "track_bearings",
    "track_images",
    "track_several_sources",
    "track_several_arrays",
    "track_radar",
    "scenario_file",
    "active_sonar",
    "calibrate",
    "tracks",
    "channels",
}
"""Pages whose commands the tests of the command line and of sessions give as well, on smaller files."""
MODULE = re.compile(r"# (\w+\.py)\n")
SHOWN_ONLY = {"bash", "text"}
"""Languages of blocks that nothing can check."""
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    samples = np.random.default_rng(0).normal(size=(12_000, 8)).astype(np.float32)
    write_recording(folder / "night.wav", [samples], 4000.0)
    (folder / "array.toml").write_text("line = {count = 8, spacing = 0.5}\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=page.stem, marks=pytest.mark.slow if page.stem in LONG else ())
        for page in PAGES
        if FENCE.search(page.read_text(encoding="utf-8"))
    ],
)
def test_what_a_page_shows_runs(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    # What a page imports that it wrote before, and the kinds that it adds, are of this page alone.
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(kinds, "KINDS", dict(kinds.KINDS))
    matplotlib.use("Agg")
    names: dict[str, object] = {}
    for language, block in FENCE.findall(page.read_text(encoding="utf-8")):
        if language == "python" and MODULE.match(block):
            Path(MODULE.match(block)[1]).write_text(block, encoding="utf-8")
        elif language == "python":
            run_python(block, names, page)
        elif language == "console":
            run_commands(block)
        elif language == "toml":
            read_toml(block)
        else:
            assert language in SHOWN_ONLY, f"{page}: a block of {language}"


def run_python(block: str, names: dict[str, object], page: Path) -> None:
    if ">>>" not in block:
        exec(compile(block, str(page), "exec"), names)
        return
    test = doctest.DocTestParser().get_doctest(block, names, page.name, str(page), 0)
    said: list[str] = []
    failed, _ = doctest.DocTestRunner(optionflags=FLAGS).run(test, out=said.append, clear_globs=False)
    names.update(test.globs)
    assert not failed, "".join(said)


def run_commands(block: str) -> None:
    for line in block.splitlines():
        prompt, program, *arguments = shlex.split(line)
        assert (prompt, program) == ("$", "faintrack"), line
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, f"{line}\n{result.output}{result.exception!r}"


def read_toml(block: str) -> None:
    file = Path(block.splitlines()[0].removeprefix("# "))
    file.write_text(block, encoding="utf-8")
    read = Scenario.read if file.name.startswith("scenario") else read_array
    read(file)


def test_the_reference_names_every_module() -> None:
    source = ROOT / "src" / "faintrack"
    files = [
        file for file in source.rglob("*.py") if file.stem != "__init__" and not {"cli", "bench"} & set(file.parts)
    ]
    modules = {".".join(file.relative_to(source.parent).with_suffix("").parts) for file in files}
    pages = (ROOT / "docs" / "reference").glob("*.md")
    listed = set(re.findall(r"automodule:: (\S+)", "".join(page.read_text(encoding="utf-8") for page in pages)))
    assert not modules - listed
    assert not {name for name in listed if not (source.parent / name.replace(".", "/")).exists()} - modules
