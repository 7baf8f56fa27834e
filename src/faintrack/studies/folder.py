"""The folder of a study: what was asked for, the runs that are done, and nothing else to remember.

.. code-block:: text

    study.json      study, seed, runs of each setting, versions
    runs.zarr       a group for each setting; first axis of every array: runs; `done` tells which are
    rows.json       the study's numbers, once all runs are done
    *.png           its figures

A batch of runs is one chunk of each array, and is marked as done after it is written: whatever happens in between, the
batch is computed again, with the same bits. One process at a time may write; a lock that the system drops with the
process sees to that.
"""

import contextlib
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr

from faintrack.errors import InputError
from faintrack.io.checks import explained
from faintrack.io.locks import Held, locked
from faintrack.studies.study import Setting, Study

FORMAT = 1
"""Of the folder; another is not read."""


@dataclass(frozen=True)
class Plan:
    """What a study was asked for.

    Attributes
    ----------
    study : its name.
    seed : of all runs.
    quick : whether it is the quick one.
    runs : of each setting.
    """

    study: str
    seed: int
    quick: bool
    runs: dict[str, int]


class Folder:
    """A study's folder, open for writing; make one with `open_folder`."""

    def __init__(self, path: Path, study: Study, plan: Plan) -> None:
        self.path, self.study, self.plan = path, study, plan

    def missing(self, setting: Setting) -> list[int]:
        """First run of every batch that is not done.

        Raises
        ------
        InputError : what tells of them is damaged, or they were computed with other parameters.
        """
        runs = self.plan.runs[setting.name]
        starts = np.arange(0, runs, setting.batch)
        if not self._started(setting):
            return starts.tolist()
        with self._dataset(setting) as data:
            # The last batch of a study that was extended may be done in part.
            done = np.logical_and.reduceat(data.done.values[:runs], starts)
        return starts[~done].tolist()

    def write(self, setting: Setting, first: int, arrays: dict[str, np.ndarray]) -> None:
        """Keep a batch of runs, then mark it as done.

        Raises
        ------
        InputError : the disk is full, or cannot be written for another reason.
        """
        runs = self.plan.runs[setting.name]
        used = min(setting.batch, runs - first)
        region = {"run": slice(first, first + used)}
        with self._writing():
            if not self._started(setting):
                self._start(setting, arrays)
            values = {name: (("run", *setting.axes[name]), array[:used]) for name, array in arrays.items()}
            for variables in (values, {"done": ("run", np.ones(used, bool))}):
                xr.Dataset(variables).to_zarr(self._runs, group=setting.name, region=region, consolidated=False)

    def results(self, name: str) -> xr.Dataset:
        """Finished runs of a setting, in memory.

        Raises
        ------
        InputError : there are none, or they are damaged.
        """
        setting = self.study.setting(name)
        if not self._started(setting):
            raise InputError(f"{self.path} has no run of setting {name} yet.")
        with self._dataset(setting) as data:
            return data.isel(run=np.flatnonzero(data.done.values)).drop_vars("done").load()

    def describe(self) -> None:
        """Write what was asked for."""
        content = {"format": FORMAT, "version": version("faintrack"), **vars(self.plan)}
        self.keep("study.json", json.dumps(content, indent=2) + "\n")

    def make_room(self) -> None:
        """Lengthen the arrays of every setting that was begun with fewer runs.

        Raises
        ------
        InputError : they are damaged, or cannot be written.
        """
        for setting in self.study.settings:
            if self._started(setting):
                with self._telling_damage(setting), self._writing():
                    for _, array in zarr.open_group(self._runs, path=setting.name, mode="r+").arrays():
                        array.resize((self.plan.runs[setting.name], *array.shape[1:]))

    def keep(self, name: str, text: str) -> None:
        """Write a text file of the folder, beside and renamed."""
        beside = self.path / f".{name}.part"
        beside.write_text(text, encoding="utf-8")
        beside.replace(self.path / name)

    @property
    def _runs(self) -> Path:
        return self.path / "runs.zarr"

    def _started(self, setting: Setting) -> bool:
        return (self._runs / setting.name).exists()

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """What the disk refuses within the block is told in one sentence."""
        try:
            yield
        except OSError as error:
            raise InputError(
                f"{self.path} cannot be written ({error.strerror or error}); what was written before is kept. Make "
                "room and run again with --resume."
            ) from error

    def _telling_damage(self, setting: Setting) -> contextlib.AbstractContextManager[None]:
        return explained(f"{self._runs / setting.name} is damaged; delete it and run again with --resume")

    @contextlib.contextmanager
    def _dataset(self, setting: Setting) -> Iterator[xr.Dataset]:
        """Runs of a setting, open for reading; damage that shows within the block is told, and other parameters."""
        with (
            self._telling_damage(setting),
            xr.open_zarr(self._runs, group=setting.name, chunks=None, consolidated=False) as data,
        ):
            for name in sorted({*data.attrs, *setting.parameters}):
                then, now = data.attrs.get(name), setting.parameters.get(name)
                if then != now:
                    raise InputError(
                        f"{self._runs / setting.name} has runs with {name} = {then}; it is {now} in the study now. "
                        "Give another --out."
                    )
            yield data

    def _start(self, setting: Setting, arrays: dict[str, np.ndarray]) -> None:
        """Lay out the arrays of a setting, empty."""
        import dask.array

        runs = self.plan.runs[setting.name]

        def empty(shape: tuple[int, ...], dtype: Any) -> Any:
            return dask.array.zeros((runs, *shape), dtype=dtype, chunks=(setting.batch, *shape))

        variables = {name: (("run", *setting.axes[name]), empty(a.shape[1:], a.dtype)) for name, a in arrays.items()}
        data = xr.Dataset({**variables, "done": ("run", empty((), bool))}, attrs=dict(setting.parameters))
        beside = f".{setting.name}.part"
        data.to_zarr(self._runs, group=beside, mode="w", compute=False, zarr_format=2, consolidated=False)
        (self._runs / beside).replace(self._runs / setting.name)


@contextlib.contextmanager
def open_folder(
    path: Path, study: Study, seed: int | None, quick: bool, runs: int | None, resume: bool
) -> Iterator[Folder]:
    """Open the folder of a study for writing, or make it.

    Parameters
    ----------
    path : of the folder.
    study : whose runs it keeps.
    seed, quick, runs : what is asked for; where a study is resumed, what was asked for then, unless given.
    resume : go on with what is there; with more `runs` than it was asked for then, these are added.

    Raises
    ------
    InputError : there are runs and `resume` is not given; the folder is another study's, another version's, or that of
        other settings; there are more runs than asked for; another process writes to it; it cannot be written.
    """
    described = path / "study.json"
    try:
        path.mkdir(parents=True, exist_ok=True)
        if not described.exists():
            _refuse_strangers(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}); expected a folder.") from error
    with contextlib.ExitStack() as held:
        try:
            held.enter_context(locked(path / ".lock", keep=True))
        except Held as error:
            raise InputError(f"{path} is in use by another study that runs now; give another --out.") from error
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}); expected a folder.") from error
        asked = Plan(
            study.name,
            0 if seed is None else seed,
            quick,
            {s.name: _asked_runs(s, quick, runs) for s in study.settings},
        )
        if not described.exists():
            folder = Folder(path, study, asked)
            folder.describe()
        else:
            if not resume:
                raise InputError(f"{path} holds a study; add --resume to go on with it, or give another --out.")
            kept = _read_plan(described, study)
            if seed is not None and seed != kept.seed:
                raise InputError(f"{described}: the study has seed {kept.seed}; {seed} was asked for.")
            if quick and not kept.quick:
                raise InputError(f"{described}: the study is a full one; a quick one was asked for.")
            folder = Folder(path, study, kept)
            if runs is not None:
                longer = {s.name: _asked_runs(s, kept.quick, runs) for s in study.settings}
                if any(longer[name] < count for name, count in kept.runs.items()):
                    raise InputError(
                        f"{described}: the study has runs {kept.runs}; {runs} of each were asked for, expected no "
                        "fewer."
                    )
                folder = Folder(path, study, replace(kept, runs=longer))
                # Arrays that are longer than the plan are read up to its end, a plan beyond the arrays is not.
                folder.make_room()
                folder.describe()
        yield folder


def _asked_runs(setting: Setting, quick: bool, runs: int | None) -> int:
    """Runs of a setting; one that a quick study leaves out stays out."""
    usual = setting.quick if quick else setting.runs
    return usual if runs is None or usual == 0 else runs


def _refuse_strangers(path: Path) -> None:
    strangers = sorted(entry.name for entry in path.iterdir() if entry.name != ".lock")
    if strangers:
        raise InputError(f"{path} holds {strangers[0]} and no study.json; expected an empty folder or a study's.")


def _read_plan(described: Path, study: Study) -> Plan:
    try:
        content = json.loads(described.read_text(encoding="utf-8"))
        theirs = content["format"], content["version"]
        runs = {name: int(count) for name, count in content["runs"].items()}
        plan = Plan(content["study"], int(content["seed"]), bool(content["quick"]), runs)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{described} cannot be read ({error}); expected what a study wrote there.") from error
    if plan.study != study.name:
        raise InputError(f"{described} is of study {plan.study}; expected {study.name}. Give another --out.")
    ours = FORMAT, version("faintrack")
    if theirs != ours:
        raise InputError(
            f"{described} is of faintrack {theirs[1]}, format {theirs[0]}; this is {ours[1]}, format {ours[0]}, whose "
            "runs may differ. Give another --out."
        )
    names = {setting.name for setting in study.settings}
    if set(plan.runs) != names:
        raise InputError(f"{described}: settings are not those of the study now; give another --out.")
    return plan
