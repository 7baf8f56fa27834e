"""Where compiled programs are kept, on every system, and that nothing fails where they cannot be."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from faintrack.numerics.compiled import cache_folder

TWO_PROGRAMS = """
import jax, jax.numpy as jnp
from faintrack.numerics.compiled import keep_compilations
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
print(jax.jit(jnp.sin)(1.0))
keep_compilations()
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
print(jax.jit(jnp.cos)(1.0))
"""
"""One compiled before anything is said of keeping it, one after."""


@pytest.mark.parametrize(
    ("platform", "variable", "expected"),
    [
        ("linux", "XDG_CACHE_HOME", "faintrack"),
        ("linux", "HOME", ".cache/faintrack"),
        ("darwin", "HOME", "Library/Caches/faintrack"),
        ("darwin", "XDG_CACHE_HOME", "faintrack"),
        ("win32", "LOCALAPPDATA", "faintrack"),
        ("win32", "HOME", "AppData/Local/faintrack"),
    ],
)
def test_the_folder_is_that_of_the_system(
    platform: str, variable: str, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setenv(variable, str(tmp_path))
    assert cache_folder() == tmp_path / expected
    assert (tmp_path / expected).is_dir()


def test_a_folder_that_cannot_be_written_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert cache_folder() is None


def programs(**environment: str) -> str:
    """What a new process prints that compiles two programs and keeps what it may."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", TWO_PROGRAMS],
        env={**inherited, "JAX_PLATFORMS": "cpu", **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout + done.stderr


def test_programs_are_kept_where_the_user_says_and_else_in_the_cache(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    said = programs(XDG_CACHE_HOME=str(tmp_path / "caches"))
    kept = [entry.name for entry in (tmp_path / "caches" / "faintrack").iterdir()]
    assert any("cos" in name for name in kept)
    own = {"JAX_COMPILATION_CACHE_DIR": str(tmp_path / "own")}
    assert programs(XDG_CACHE_HOME=str(tmp_path / "other"), **own) == said
    assert (tmp_path / "own").is_dir()
    assert not (tmp_path / "other").exists()
    assert programs(XDG_CACHE_HOME=str(tmp_path / "file")) == said
