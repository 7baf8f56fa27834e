r"""What is read off the runs: the measure of the published filters, and its parts.

Found is a target whose existence is above a half, at its mean place. Found and true targets of a scan are compared by
GOSPA (`faintrack.metrics.sets.gospa`) with order 2, cutoff 5 m and alpha 2; its root mean square is over scans and
runs,

.. math:: \sqrt{\frac{1}{K R} \sum_{k, r} d_{kr}^2}

and its square is the sum of three parts: what the errors of place, missed and false targets bring, the latter 12.5 m^2
each. `seconds_a_run` is of one run alone, the slower of both births, after compilation, measured when the rows are
made."""

import functools

import jax
import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.metrics.sets import gospa
from faintrack.studies.printed import PRINTED
from faintrack.studies.rows import beside, bootstrapped, mean, row, seconds
from faintrack.studies.study import Results, Row, ran
from faintrack.studies.superposed import scene
from faintrack.studies.superposed.settings import SETTINGS

FOUND, CUTOFF = 0.5, 5.0
"""Existence from which on a target counts as found; metres."""

REPEATS = 3
"""Runs of which the fastest is timed."""

LABELS = {1: "births anywhere", 2: "births at known places"}
"""Births, for people."""

PARTS = "errors of place", "missed", "false"
"""Of the squared distance, in the order of `parts`."""


def parts(run: xr.Dataset) -> Float[np.ndarray, "run scan part"]:
    """Squared GOSPA of every run and scan in its parts: place, missed, false; m^2."""
    existence, x, y = (np.asarray(run[name]) for name in ("existence", "x", "y"))
    whole = scene.truth()
    made = np.zeros((*existence.shape[:2], 3))
    for scan in range(existence.shape[1]):
        there = np.isfinite(whole.x[scan])
        true = np.column_stack([whole.x[scan, there], whole.y[scan, there]])
        for number in range(len(existence)):
            found = existence[number, scan] > FOUND
            at = np.column_stack([x[number, scan, found], y[number, scan, found]])
            apart = gospa(at, true, CUTOFF)
            made[number, scan] = apart.localisation, apart.missed, apart.false
    return made


def rows(results: Results) -> list[Row]:
    """The study's numbers; births that have not run leave their rows out."""
    finished = ran(results, {1: "births1", 2: "births2"})
    ours = [each for births, run in finished.items() for each in of_births(births, parts(run))]
    if ours:
        ours.append(row("seconds_a_run", "time of a run", "s", max(_time(births) for births in finished)))
    return beside(PRINTED["superposed"], ours)


def of_births(births: int, made: Float[np.ndarray, "run scan part"]) -> list[Row]:
    """Rows of runs with one kind of birth."""
    name = LABELS[births]
    squared = made.sum(axis=2).mean(axis=1)
    whole = bootstrapped(
        f"gospa_rms_births{births}_m", f"{name}: RMS GOSPA", "m", lambda each: each.mean() ** 0.5, squared
    )
    return [
        whole,
        *(
            mean(f"{part.split()[-1]}_births{births}_m2", f"{name}: {part}, part of its square", "m^2", each)
            for part, each in zip(PARTS, made.mean(axis=1).T, strict=True)
        ),
    ]


@functools.cache
def _time(births: int) -> float:
    """Seconds of one run."""
    follow, key = jax.jit(SETTINGS[births - 1].run), jax.random.key(0)
    jax.block_until_ready(follow(key))
    return min(seconds(lambda: follow(key)) for _ in range(REPEATS))
