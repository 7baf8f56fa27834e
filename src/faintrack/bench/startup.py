"""How long a person waits before anything happens."""

import subprocess
import sys

from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, timed
from faintrack.bench.sizes import Sizes


def import_seconds(machine: Machine, sizes: Sizes) -> Row:
    """`import faintrack` in a fresh interpreter."""
    return _row("import_seconds", ["-c", "import faintrack"], sizes)


def help_seconds(machine: Machine, sizes: Sizes) -> Row:
    """`faintrack --help` in a fresh interpreter."""
    return _row("help_seconds", ["-m", "faintrack.cli", "--help"], sizes)


def _row(name: str, arguments: list[str], sizes: Sizes) -> Row:
    def python(*arguments: str) -> None:
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)

    timing = timed(lambda: python(*arguments), sizes.repeat_seconds)
    bare = timed(lambda: python("-c", "pass"), sizes.repeat_seconds)
    return Row(
        name=name,
        unit="s",
        ours=timing.least,
        peer=None,
        limit=bare.least,
        target=0.5,
        median=timing.median,
        compile_seconds=None,
        note=f"python {' '.join(arguments)}, files read before; no peer; limit: an interpreter that does nothing",
    )
