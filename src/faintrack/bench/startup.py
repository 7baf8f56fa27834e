"""How long a person waits in the shell."""

import dataclasses
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, row, timed
from faintrack.bench.sizes import Sizes

TENET = """
import jax, jax.numpy as jnp
from faintrack.beliefs.axis import Axis
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import run
from faintrack.likelihoods.cells import CellLikelihood, rayleigh
from faintrack.sensors.cells import Cells
from faintrack.simulation.cells import draw_scans
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth

likelihood = CellLikelihood(Cells((("y", Axis(-3.0, 0.1, 61)), ("x", Axis(-1.5, 0.1, 61)))), rayleigh, 10.9)
time = jnp.arange(11.0)
truth = PlanarState(0.2 * time, 0 * time, 0 * time + 0.2, 0 * time)
scans = draw_scans(jax.random.key(0), likelihood, time, truth, time >= 0)
corners = (PlanarState(*map(jnp.array, corner)) for corner in ((-1.5, -3.0, -0.5, -0.6), (4.5, 3.0, 0.7, 0.6)))
target = Target(UniformBirth(*corners), PlanarMotion(5e-4**0.5), 0.0, 0.0)
filter = BernoulliParticleFilter(target, 100_000, births=1)
start = jax.jit(lambda key: filter.init(key, existence=0.1))(jax.random.key(1))
_, odds, _ = run(filter, likelihood, scans, jax.random.key(2), lambda belief: belief.log_odds, start)
print(odds)
"""
"""The example of stone2002, section 4.3, in a script of a user."""


def import_seconds(machine: Machine, sizes: Sizes) -> Row:
    """`import faintrack` in a fresh interpreter."""
    return _row("import_seconds", ["-c", "import faintrack"], sizes)


def help_seconds(machine: Machine, sizes: Sizes) -> Row:
    """`faintrack --help` in a fresh interpreter."""
    return _row("help_seconds", ["-m", "faintrack.cli", "--help"], sizes)


def tenet_seconds(machine: Machine, sizes: Sizes) -> Row:
    """The TENET example of stone2002, 61 x 61 pixels and 100,000 points, once compiled, in a fresh interpreter."""
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "tenet.py"
        script.write_text(TENET, encoding="utf-8")
        return _row("tenet_seconds", [str(script)], sizes, target=4.0, kept=folder)


def _row(name: str, arguments: list[str], sizes: Sizes, target: float = 0.5, kept: str | None = None) -> Row:
    """One row; `kept` is where compilations are kept between repeats."""
    environment = dict(os.environ)
    if kept is not None:
        environment |= {"JAX_COMPILATION_CACHE_DIR": kept, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}

    def python(*arguments: str) -> None:
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=environment)

    command = " ".join(Path(argument).name for argument in arguments)
    timing = timed(lambda: python(*arguments), sizes.repeat_seconds)
    bare = timed(lambda: python("-c", "pass"), sizes.repeat_seconds)
    if kept is None:
        timing = dataclasses.replace(timing, compile=None)
    note = f"python {command}, files read before; no peer; limit: an interpreter that does nothing"
    return row(name, "s", timing, note, target, limit=bare.least)
