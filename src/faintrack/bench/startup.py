"""How long a person waits in the shell."""

import os
import subprocess
import sys
import tempfile

from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, timed
from faintrack.bench.sizes import Sizes


def import_seconds(machine: Machine, sizes: Sizes) -> Row:
    """`import faintrack` in a fresh interpreter."""
    return _row("import_seconds", ["-c", "import faintrack"], sizes)


def help_seconds(machine: Machine, sizes: Sizes) -> Row:
    """`faintrack --help` in a fresh interpreter."""
    return _row("help_seconds", ["-m", "faintrack.cli", "--help"], sizes)


def tenet_seconds(machine: Machine, sizes: Sizes) -> Row:
    """The TENET example of stone2002, 61 x 61 pixels and 100,000 points, once compiled, in a fresh interpreter."""
    code = "from faintrack.studies.study import repeat; repeat('stone2002', 'tenet_points', 0)"
    with tempfile.TemporaryDirectory() as kept:
        return _row("tenet_seconds", ["-c", code], sizes, target=4.0, kept=kept)


def _row(name: str, arguments: list[str], sizes: Sizes, target: float = 0.5, kept: str | None = None) -> Row:
    """One row; `kept` is where compilations are kept between repeats."""
    environment = dict(os.environ)
    if kept is not None:
        environment |= {"JAX_COMPILATION_CACHE_DIR": kept, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}

    def python(*arguments: str) -> None:
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=environment)

    timing = timed(lambda: python(*arguments), sizes.repeat_seconds)
    bare = timed(lambda: python("-c", "pass"), sizes.repeat_seconds)
    return Row(
        name=name,
        unit="s",
        ours=timing.least,
        peer=None,
        limit=bare.least,
        target=target,
        median=timing.median,
        compile_seconds=None if kept is None else timing.compile,
        note=f"python {' '.join(arguments)}, files read before; no peer; limit: an interpreter that does nothing",
    )
