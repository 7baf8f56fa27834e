"""What a study is: a table of settings times seeded runs, and what is read off the results.

A run is a pure function of a key and the setting's parameters. The key of a run follows from the study's seed, the
setting's name and the run's number, so every run can be repeated alone, in any order and on any machine (`repeat`).
Runs are compiled in batches of fixed size, `jax.vmap` over keys; the number of workers changes who computes a batch and
not what is computed.

A study of your own is a module with a `Study`, named as `module:attribute` where a study's name is asked for.
"""

import functools
import importlib
import sys
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Integer, PRNGKeyArray

from faintrack.errors import InputError

STUDIES = {
    "aughenbaugh2010": "faintrack.studies.aughenbaugh2010:study",
    "bosser2022": "faintrack.studies.bosser2022:study",
    "davey2008": "faintrack.studies.davey2008:study",
    "kreucher2011": "faintrack.studies.kreucher2011:study",
    "liu2013": "faintrack.studies.liu2013:study",
    "stone2002": "faintrack.studies.stone2002:study",
    "superposed": "faintrack.studies.superposed:study",
}
"""Studies that come with the package: name, and where it is."""

HURRIED: dict[str, Any] = {"xla_backend_optimization_level": 1, "xla_cpu_use_fusion_emitters": False}
"""By which XLA compiles in less than half of the time what then runs a third slower."""

Results = Callable[[str], xr.Dataset]
"""Finished runs of a setting by its name."""


@dataclass(frozen=True)
class Setting:
    """One row of a study's table.

    Attributes
    ----------
    name : within the study; part of the address of its runs.
    run : function of a key and the parameters by name, to named arrays, of one run; at the top of a module.
    runs : in a full study.
    quick : runs of a quick one.
    axes : names of the axes of each array that `run` returns.
    parameters : what `run` is called with beside the key; numbers, which do not make it compile again.
    scans : of a run; says how long one takes beside those of other settings.
    batch : runs computed side by side.
    address : part of the address of its runs; settings with the same one draw the same data. Its name where not given.
    """

    name: str
    run: Callable[..., dict[str, Array]]
    runs: int
    quick: int
    axes: Mapping[str, tuple[str, ...]]
    parameters: Mapping[str, float] = field(default_factory=dict)
    scans: int = 1
    batch: int = 32
    address: str = ""


@dataclass(frozen=True)
class Row:
    """One number of a study.

    Attributes
    ----------
    key : for programs.
    name : for people.
    unit : of all numbers of the row; "1" for a share.
    paper : what the paper says, where it does.
    ours : what the runs say; None where they cannot.
    interval : 95 % interval of `ours`; None, beyond what the runs can tell.
    """

    key: str
    name: str
    unit: str
    paper: float | None
    ours: float | None
    interval: tuple[float | None, float | None] = (None, None)

    def as_dict(self) -> dict[str, Any]:
        """Row as `--json` prints it."""
        return {
            "key": self.key,
            "name": self.name,
            "unit": self.unit,
            "paper": self.paper,
            "ours": _finite(self.ours),
            "interval": [_finite(bound) for bound in self.interval],
        }


@dataclass(frozen=True)
class Study:
    """Settings, and what is read off their results.

    Attributes
    ----------
    name : of the study.
    title : one line.
    settings : the table.
    rows : function of the results to the study's numbers.
    figures : function of the results and a folder; draws pictures there and returns their paths.
    brief : a quick study of it takes longer to compile than to run, so that XLA is told to hurry, and the command line
        computes it without workers.
    """

    name: str
    title: str
    settings: tuple[Setting, ...]
    rows: Callable[[Results], list[Row]]
    figures: Callable[[Results, Path], list[Path]]
    brief: bool = False

    def setting(self, name: str) -> Setting:
        """Setting of that name."""
        for setting in self.settings:
            if setting.name == name:
                return setting
        raise InputError(
            f"study {self.name} has no setting {name}; expected one of {', '.join(s.name for s in self.settings)}."
        )


def finished(results: Results, name: str) -> xr.Dataset | None:
    """Runs of a setting, if there are any."""
    try:
        data = results(name)
    except InputError:
        return None
    return data if data.sizes["run"] else None


def ran(results: Results, names: Mapping[Any, str]) -> dict[Any, xr.Dataset]:
    """Runs of those settings that have any, by whatever their names are given by."""
    settings = {of: finished(results, name) for of, name in names.items()}
    return {of: data for of, data in settings.items() if data is not None}


def load(where: str) -> Study:
    """Study by its name, or by `module:attribute`, the module installed or in the folder that one stands in.

    Raises
    ------
    InputError : there is none.

    Examples
    --------
    >>> load("nothing")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    faintrack.errors.InputError: no study is called nothing; expected one of aughenbaugh2010, ...
    """
    place = STUDIES.get(where, where)
    module, _, attribute = place.partition(":")
    if not attribute:
        raise InputError(
            f"no study is called {where}; expected one of {', '.join(sorted(STUDIES))}, or module:attribute."
        )
    if where not in STUDIES and (here := str(Path.cwd())) not in sys.path:
        # Python puts it there for `python -m`, not for an installed command.
        sys.path.insert(0, here)
    try:
        study = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise InputError(f"study {where} cannot be imported ({error}).") from error
    if not isinstance(study, Study):
        raise InputError(f"{where} is a {type(study).__name__}; expected a Study.")
    return study


def address(seed: int, setting: str, run: int | Integer[Array, ""]) -> PRNGKeyArray:
    """Key of one run.

    Examples
    --------
    >>> bool((address(0, "noise", 7) == address(0, "noise", 7)) & (address(0, "noise", 7) != address(0, "noise", 8)))
    True
    """
    return _address(jax.random.key(seed), zlib.crc32(setting.encode()), run)


def _address(key: PRNGKeyArray, setting: int | Integer[Array, ""], run: int | Integer[Array, ""]) -> PRNGKeyArray:
    return jax.random.fold_in(jax.random.fold_in(key, setting), run)


def run_batch(where: str, setting_name: str, seed: int, first: int, quick: bool = False) -> dict[str, np.ndarray]:
    """One batch of runs, from the run `first` on; first axis of every array: runs."""
    study = load(where)
    setting = study.setting(setting_name)
    parameters = {name: np.float32(value) for name, value in setting.parameters.items()}
    batched = _batched(setting.run, setting.batch, quick and study.brief)
    number = np.uint32(zlib.crc32((setting.address or setting.name).encode()))
    arrays = batched(jax.random.key(seed), number, np.uint32(first), parameters)
    return {name: np.asarray(values) for name, values in arrays.items()}


def repeat(where: str, setting_name: str, run: int, seed: int = 0, quick: bool = False) -> dict[str, np.ndarray]:
    """One run again: the arrays that the study kept of it, bit for bit on the same kind of machine.

    Those of a quick study, where it was `quick`; they may be rounded otherwise.
    """
    batch = load(where).setting(setting_name).batch
    arrays = run_batch(where, setting_name, seed, run - run % batch, quick)
    return {name: np.asarray(values[run % batch]) for name, values in arrays.items()}


@functools.cache
def compiled_in_a_hurry() -> dict[str, Any] | None:
    """Compiler options for what runs once: `HURRIED`, where this version of the compiler knows them."""
    try:
        jax.jit(lambda: 0, compiler_options=HURRIED)()
    except jax.errors.JaxRuntimeError:
        return None
    return HURRIED


@functools.cache
def _batched(run: Callable[..., dict[str, Array]], batch: int, hurried: bool) -> Callable[..., dict[str, Array]]:
    def batched(key: PRNGKeyArray, setting: Array, first: Array, parameters: Mapping[str, Array]) -> dict[str, Array]:
        keys = jax.vmap(lambda run: _address(key, setting, run))(first + jnp.arange(batch, dtype=jnp.uint32))
        # Mapped over an axis, `jax.lax.cond` takes both branches; a run alone need not.
        over = jax.lax.map if batch == 1 else lambda one, keys: jax.vmap(one)(keys)
        return over(lambda key: run(key, **parameters), keys)

    return jax.jit(batched, compiler_options=compiled_in_a_hurry() if hurried else None)


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)
