"""A whole study as a person runs it: start, compile, compute, count, draw."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, Timing, row
from faintrack.bench.sizes import Sizes

TARGET_SECONDS = 20.0


def study_seconds(machine: Machine, sizes: Sizes) -> Row:
    """The quick study of liu2013: 100 runs, its three methods in both forms of the likelihood, compilation included."""
    with tempfile.TemporaryDirectory(prefix="faintrack-") as folder:
        command = [sys.executable, "-m", "faintrack.cli", "study", "run", sizes.study, "--quick", "--json"]
        fresh = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(Path(folder) / "compiled")}
        start = time.perf_counter()
        subprocess.run([*command, "--out", str(Path(folder) / "out")], env=fresh, check=True, capture_output=True)
        seconds = time.perf_counter() - start
    note = (
        f"`faintrack study run {sizes.study} --quick` once, from the shell with nothing compiled before: "
        "imports, compilation, runs, intervals and figures; no peer"
    )
    return row("study_seconds", "s", Timing(seconds, seconds, None), note, TARGET_SECONDS)
