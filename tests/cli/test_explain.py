"""Every field of a scenario is explained; what the shell completes is what is known; tables fit a terminal."""

import json
import os
import subprocess
import sys

import pytest

from faintrack.cli.tables import _print
from faintrack.errors import InputError
from faintrack.kinds import KINDS, kinds
from faintrack.kinds.explain import explain, field_names
from tests.cli.calling import call


def test_every_field_of_every_kind_has_a_meaning() -> None:
    silent = [one.field for name in field_names() for one in explain(name) if one.field == name and not one.meaning]
    # Arrays describe themselves in the documentation of their file.
    assert not [name for name in silent if not name.startswith(("array.", "kind", "stations.array"))]


def test_every_section_is_there() -> None:
    names = field_names()
    for kind in kinds():
        for section in kind.scenario.model_fields:
            assert any(name == section or name.startswith(f"{section}.") for name in names), section


def test_bounds_and_defaults_are_those_that_hold() -> None:
    (one,) = [one for one in explain("tracker.declare") if "frames" in one.kinds]
    assert (one.values, one.default, one.required) == ("above 0, below 1", "0.97", False)
    (memory,) = explain("frames.memory")
    assert (memory.values, memory.default) == ("at least 0", "")
    (pulse,) = explain("sonar.pulse.frequency")
    assert pulse.required
    assert all(set(one.kinds) <= set(KINDS) for one in explain("declare"))


def test_a_slip_is_answered_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"there is no field tracker.declar; did you mean tracker.declare\?"):
        explain("tracker.declar")
    with pytest.raises(InputError, match="there is no field qqqq; faintrack init KIND"):
        explain("qqqq")


def test_the_command_explains() -> None:
    done = call("explain", "declare", "--kind", "frames")
    assert done.status == 0
    assert done.out.startswith("tracker.declare\n  existence at which a track begins")
    assert max(map(len, done.out.splitlines())) <= 80
    said = json.loads(call("explain", "frames", "--json").out)
    assert {"frames.memory", "frames.background"} <= {one["field"] for one in said["fields"]}
    done = call("explain", "sonar.beams", "--kind", "frames")
    assert done.status == 2
    assert "there is no field sonar.beams in a scenario of frames" in done.err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("faintrack track a.wav --method ", {"bernoulli", "cfar"}),
        ("faintrack track a.wav --method c", {"cfar"}),
        ("faintrack init f", {"frames"}),
        ("faintrack explain tracker.dec", {"tracker.declare"}),
        ("faintrack export night --to ra", {"raven"}),
    ],
)
def test_the_shell_completes(words: str, expected: set[str]) -> None:
    number = len(words.split(" ")) - 1
    asked = {"_FAINTRACK_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(number)}
    code = "from faintrack.cli.app import app; app(prog_name='faintrack')"
    done = subprocess.run([sys.executable, "-c", code], env={**os.environ, **asked}, capture_output=True, text=True)
    assert set(done.stdout.split()) == expected


def test_brackets_show_in_help() -> None:
    assert "[simulation]" in call("simulate", "--help").out
    for command in ("track", "calibrate", "init", "explain", "export", "report", "info", "bench", "live", "demo"):
        assert "\\[" not in call(command, "--help").out


def test_tables_are_whole_at_80_columns(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    columns = [f"column{number}\nmetres" for number in range(14)]
    _print(columns, [[f"{row}.{number:06d}" for number in range(14)] for row in range(2)])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert "…" not in "".join(lines)
    words = " ".join(lines).split()
    assert {f"1.{number:06d}" for number in range(14)} <= set(words)
    _print(["field", "first"], [["a", "x" * 200]], text=("field", "first"))
    text = capsys.readouterr().out
    assert text.count("x") == 200
