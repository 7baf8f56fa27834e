"""A study small enough to run many times: a random walk that is asked how far it came."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PRNGKeyArray

from faintrack.studies.study import Results, Row, Setting, Study


def walk(key: PRNGKeyArray, step: Array) -> dict[str, Array]:
    place = jnp.cumsum(step * jax.random.normal(key, (20,)))
    return {"place": place, "farthest": jnp.abs(place).max()}


def rows(results: Results) -> list[Row]:
    farthest = results("short").farthest.values
    return [Row("farthest_short", "farthest from the start", "m", 1.0, float(farthest.mean()), (None, float("inf")))]


def figures(results: Results, folder: Path) -> list[Path]:
    (folder / "figure.png").write_bytes(b"picture")
    return [folder / "figure.png"]


AXES: dict[str, tuple[str, ...]] = {"place": ("scan",), "farthest": ()}
study = Study(
    "small",
    "A random walk",
    (
        Setting("short", walk, 22, 6, AXES, {"step": 1.0}, scans=20, batch=4),
        Setting("long", walk, 40, 0, AXES, {"step": 3.0}, scans=20, batch=8),
    ),
    rows,
    figures,
    brief=True,
)
other = Study("other", "Another", study.settings, rows, figures)


def fatal(key: PRNGKeyArray) -> dict[str, Array]:
    """Ends the process that computes it."""
    import os

    def end(value: np.ndarray) -> np.ndarray:
        os._exit(1)

    value = jax.pure_callback(
        end, jax.ShapeDtypeStruct((), jnp.float32), jax.random.normal(key), vmap_method="sequential"
    )
    return {"value": value}


deadly = Study("deadly", "Kills its workers", (Setting("end", fatal, 1, 1, {"value": ()}, batch=1),), rows, figures)
WHERE = "tests.studies.small:study"
