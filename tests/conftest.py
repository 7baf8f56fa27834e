"""Fixtures that more than one file of tests uses."""

from collections.abc import Iterator

import jax
import numpy as np
import pytest

from tests.scenes import CIRCLE, LINE, Scene


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
