"""Fixtures that more than one file of tests uses, and where compiled programs are kept."""

import gc
import os
from collections.abc import Iterator
from pathlib import Path

import jax
import numpy as np
import pytest

from tests.scenes import CIRCLE, LINE, Scene

# What one process has compiled, the others read: processes of a run, workers of a study, and the next run.
CACHES = Path(__file__).parent.parent / ".cache"
COMPILED = {
    "jax_compilation_cache_dir": str(CACHES / "faintrack"),
    "jax_persistent_cache_min_compile_time_secs": 0.0,
}
# Most of the suite's time goes into compiling what runs for a moment: half of it, for slower code.
QUICKLY_COMPILED = (
    "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true --xla_cpu_use_fusion_emitters=false"
)
os.environ["XLA_FLAGS"] = f"{QUICKLY_COMPILED} {os.environ.get('XLA_FLAGS', '')}"
os.environ["XDG_CACHE_HOME"] = str(CACHES)
for option, value in COMPILED.items():
    os.environ[option.upper()] = str(value)
    jax.config.update(option, value)


# With Python's own thresholds a search for garbage goes through all that was ever compiled, again and again.
gc.set_threshold(100_000, 50, 50)

LARGEST = 2 * 2**30
"""Bytes of a process beyond which what it has compiled is given up: every program is mapped into memory, and a process
may have so many maps and no more."""


@pytest.fixture(autouse=True, scope="module")
def _bounded() -> Iterator[None]:
    yield
    statm = Path("/proc/self/statm")
    if statm.exists() and int(statm.read_text(encoding="utf-8").split()[1]) * os.sysconf("SC_PAGE_SIZE") > LARGEST:
        jax.clear_caches()
        gc.collect()


@pytest.fixture(params=["float32", "float64"])
def dtype(request: pytest.FixtureRequest) -> Iterator[type]:
    """Type of real values; a test that asks for it runs once in each precision."""
    with jax.enable_x64(request.param == "float64"):
        yield np.dtype(request.param).type


@pytest.fixture
def float64() -> Iterator[type]:
    """For what is exact, so that the tolerance tells a mistake from rounding."""
    with jax.enable_x64(True):
        yield np.float64


@pytest.fixture
def scene() -> Scene:
    return SCENE


@pytest.fixture(params=["line", "circle"])
def either_scene(request: pytest.FixtureRequest) -> Scene:
    """A line array, and one that hears the full circle."""
    return {"line": SCENE, "circle": ROUND}[request.param]


SCENE, ROUND = Scene(np.float32, LINE), Scene(np.float32, CIRCLE)
