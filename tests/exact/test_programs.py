"""Programs kept between processes: found by everything that they follow from, and the same bits as before."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.filters.separable import separable
from faintrack.likelihoods.cells import Amplitude, CellLikelihood, gaussian, gaussian_spread, swerling1
from faintrack.numerics.programs import Unknown, fingerprint
from faintrack.sensors.cells import Cells
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import RangeState


def name(*arguments: object) -> str:
    return fingerprint(gaussian, arguments)


def likelihood(count: int = 3, amplitude: Amplitude = gaussian, width: float = 0.55, reach: int = 1) -> CellLikelihood:
    cells = Cells((("range", Axis(0.0, 1.0, 3)),))
    return CellLikelihood(cells, amplitude, jnp.ones(count), gaussian_spread(width), reach)


def test_values_of_arrays_do_not_count_and_all_else_does() -> None:
    first = name(likelihood())
    louder = eqx.tree_at(lambda held: held.level, likelihood(), 2 * jnp.ones(3))
    assert first == name(louder) == name(likelihood())
    others = [
        name(likelihood(count=4)),
        name(eqx.tree_at(lambda held: held.level, likelihood(), jnp.ones(3, int))),
        name(eqx.tree_at(lambda held: held.level, likelihood(), 1.0)),
        name(eqx.tree_at(lambda held: held.level, likelihood(), 2.0)),
        name(likelihood(amplitude=swerling1)),
        name(likelihood(width=0.56)),
        name(likelihood(reach=2)),
        name(likelihood(), likelihood()),
        name({"a": likelihood()}),
        name([likelihood()]),
        fingerprint(swerling1, (likelihood(),)),
    ]
    assert len({first, *others}) == len(others) + 1


def test_arrays_that_are_constants_count() -> None:
    def kernels(noise: float) -> str:
        grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 9)), ("range_rate", Axis(-1.0, 1.0, 3))))
        transport = separable(grid, PlanarMotion(noise), 1.0)
        return name(partial(transport.carry))

    assert kernels(0.1) == kernels(0.1) != kernels(0.2)


def test_precision_counts_also_where_it_changes_within_a_process() -> None:
    held = likelihood()
    first = name(held)
    with jax.enable_x64(True):
        assert name(held) != first
    with jax.default_matmul_precision("highest"):
        assert name(held) != first
    assert name(held) == first


def test_what_is_not_known_by_name_is_not_kept() -> None:
    for unknown in (lambda value: value, Path("file"), object()):
        with pytest.raises(Unknown):
            name(unknown)


SCRIPT = """
import numpy as np
import faintrack as ft
from faintrack.numerics import programs

made = []
make = programs._made
programs._made = lambda path, function, arguments: made.append(function.__name__) or make(path, function, arguments)
frames = np.random.default_rng(0).normal(size=(8, 16)).astype(np.float32)
sequence = ft.from_frames(frames)
scenario = {"kind": "frames", "frames": {"background": "none"}, "cells": {"amplitude": "gaussian", "levels": [2.0]}}
result = ft.track(sequence, scenario, pictures=False)
print(made, result.data.existence.values.tobytes().hex())
"""


@pytest.mark.slow
def test_the_next_process_finds_it_and_a_file_cut_short_is_made_again(tmp_path: Path) -> None:
    def ran() -> tuple[str, str]:
        told = subprocess.run(
            [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True
        ).stdout
        made, _, bits = told.strip().rpartition(" ")
        return made, bits

    environment = {key: value for key, value in os.environ.items() if not key.startswith("JAX_")}
    environment |= {"XDG_CACHE_HOME": str(tmp_path)}
    made, bits = ran()
    assert made == "['_init', '_take_in']"
    assert ran() == ("[]", bits)
    for file in (tmp_path / "faintrack" / "programs").iterdir():
        file.write_bytes(file.read_bytes()[:-100])
    assert ran() == (made, bits)
