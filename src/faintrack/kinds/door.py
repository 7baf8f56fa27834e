"""The verbs, for every kind of data: track, follow, simulate, calibrate, read, info, read_result.

Each takes data in memory or paths, and a scenario as a path, a dictionary, a `Scenario`, or sections by name. The
command line calls the same functions and adds nothing, so that command and Python give the same numbers.
"""

import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import xarray as xr

from faintrack.errors import InputError
from faintrack.kinds import kind_named, kinds
from faintrack.kinds.kind import Kind, Plan
from faintrack.kinds.loop import Checkpoint, advance, datasets
from faintrack.kinds.promise import about_false_tracks, about_rises, keeping
from faintrack.kinds.scenario import Scenario, kind_of_sections, merged, scenario_of
from faintrack.numerics.compiled import keep_compilations
from faintrack.results.folder import open_blocks, read_folder, require_place, result_folder, write_blocks, write_rest
from faintrack.results.result import Result
from faintrack.results.schema import joined
from faintrack.results.track import Track, tracks_of
from faintrack.scenario.section import read_toml

PICTURES = ("record", "surface", "frame", "position", "velocity")
"""Variables that only pictures read."""

Progress = Callable[[int, int | None], None]
"""Is called with the scans that were just taken in, and the number of all of them."""


@dataclass(frozen=True)
class Moment:
    """What is known after a scan, or a block of them, as `follow` yields it.

    Attributes
    ----------
    data : of these scans, in the schema of `faintrack.results.schema`.
    checkpoint : where the run stands; see `faintrack.kinds.loop`.
    """

    data: xr.Dataset
    checkpoint: Checkpoint

    @property
    def time(self) -> float:
        """Of the last scan; seconds from the first one."""
        return float(self.data.time[-1])

    @property
    def tracks(self) -> list[Track]:
        """Targets in hand in these scans."""
        return tracks_of(self.data)

    @property
    def existence(self) -> float:
        """Largest probability that a target exists after the last scan."""
        return float(self.data.existence[-1].max())


@dataclass(frozen=True)
class Info:
    """What files hold.

    Attributes
    ----------
    kind : of data, its name.
    facts : by name.
    remarks : what was assumed, left out or does not fit.
    command : that tracks it.
    """

    kind: str
    facts: Mapping[str, str]
    remarks: tuple[str, ...]
    command: str

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for programs."""
        return {"kind": self.kind, **self.facts, "remarks": list(self.remarks), "command": self.command}

    def __str__(self) -> str:
        width = max(map(len, (*self.facts, "command"))) + 2
        lines = [f"{name:<{width}}{value}" for name, value in self.facts.items()]
        lines += [f"{'remark':<{width}}{remark}" for remark in self.remarks]
        return "\n".join([*lines, f"{'command':<{width}}{self.command}"])

    def _repr_html_(self) -> str:
        import html

        return f"<pre>{html.escape(str(self))}</pre>"


def track(
    what: Any,
    scenario: Any = None,
    *,
    out: str | Path | None = None,
    truth: Any = None,
    false_tracks: str | None = None,
    progress: Progress = lambda scans, total: None,
    tell: Callable[[str], None] = lambda sentence: None,
    pictures: bool = True,
    **sections: Any,
) -> Result:
    """Tracks of the targets in data of any kind.

    Parameters
    ----------
    what : a path or several, or data in memory: `Recording`, `Sequence` and so on.
    scenario : what to run: a path, a dictionary, a `Scenario`; defaults where not given.
    out : folder that data, tables, scenario and report are kept in; see `faintrack.results.folder`.
    truth : where targets really were, to lay beside the tracks: a path, see `faintrack.kinds.truth`.
    false_tracks : promised an hour or a day, "1/h", in place of the scenario's; see `faintrack.kinds.promise`.
    progress : is called while the run goes on.
    tell : is called before the run with each sentence of what was assumed, or cannot be told with this set-up.
    pictures : whether what only pictures read is kept where there is no `out`.
    sections : of the scenario, in place of its own fields: `analysis={"band": [100, 1500]}`, `array="array.toml"`.

    Raises
    ------
    InputError : data and scenario do not fit together, a file cannot be read, or nothing usable was recorded.

    Examples
    --------
    >>> import numpy as np
    >>> import faintrack as ft
    >>> noise = np.random.default_rng(0).normal(size=(4000, 8))
    >>> result = ft.track(ft.from_samples(noise, 1000.0), array={"line": {"count": 8, "spacing": 1.0}},
    ...                   analysis={"frame": 0.5})
    >>> result.tracks, result.data.sizes["time"], result.scenario.analysis.beams
    ([], 8, 180)
    """
    keep_compilations()
    if out is not None:
        require_place(out)
    kind, data, what_to_run = opened(what, scenario, sections)
    start = clock.perf_counter()
    plan = kind.plan(data, keeping(kind, what_to_run, false_tracks))
    for check in dict.fromkeys((*getattr(data, "remarks", ()), *plan.checks)):
        tell(check)
    blocks = _counted(datasets(plan), plan, progress)
    if truth is not None:
        from faintrack.kinds.truth import laid_beside

        blocks = laid_beside(blocks, truth, plan)
    if out is None:
        held = [block if pictures else block.drop_vars(PICTURES, errors="ignore") for block in blocks]
        found = joined(held)
        seconds = clock.perf_counter() - start
        return Result(
            found, plan.scenario, kind, seconds, _remarks(kind, data, plan, found), _misfits(kind, plan, found)
        )
    with result_folder(out) as folder:
        write_blocks(folder, blocks)
        seconds = clock.perf_counter() - start
        found = open_blocks(folder)
        result = Result(
            found, plan.scenario, kind, seconds, _remarks(kind, data, plan, found), _misfits(kind, plan, found)
        )
        write_rest(folder, result)
    return _reported(read_result(out), Path(out) / "report.html")


def follow(
    what: Any, scenario: Any = None, *, since: Checkpoint | None = None, block: int = 1, **sections: Any
) -> Iterator[Moment]:
    """Yield what is known after every scan, as it is taken in.

    Parameters
    ----------
    what, scenario, sections : as `track`.
    since : where an earlier run stopped.
    block : scans that are taken in at once.

    Raises
    ------
    InputError : as `track`.

    Examples
    --------
    >>> import numpy as np
    >>> import faintrack as ft
    >>> moment = next(ft.follow(ft.from_frames(np.random.default_rng(0).normal(size=(20, 24, 32)))))
    >>> moment.time, moment.tracks
    (0.0, [])
    """
    keep_compilations()
    kind, data, what_to_run = opened(what, scenario, sections)
    for checkpoint, rows in advance(kind.plan(data, keeping(kind, what_to_run)), since, block):
        yield Moment(rows, checkpoint)


def simulate(scenario: Any = None, out: str | Path | None = None, **sections: Any) -> Any:
    """Data with the targets that the scenario's `[simulation]` describes.

    Parameters
    ----------
    scenario, sections : as `track`; the kind is told by the sections.
    out : file to write; its suffix tells the format.

    Returns
    -------
    Data of the kind; drawn when they are read.

    Raises
    ------
    InputError : the scenario has no simulation, or the file cannot be written.
    """
    keep_compilations()
    given = scenario_given(scenario, sections)
    what_to_run = scenario_of(given.sections, given.source, given.folder)
    kind = kind_named(what_to_run.kind)
    data = kind.simulate(what_to_run)
    if out is not None:
        kind.write(Path(out), data)
    return data


def read(*paths: str | Path | list[str | Path], kind: str | None = None, scenario: Any = None, **sections: Any) -> Any:
    """Data of files.

    Parameters
    ----------
    paths : of one recording, of frames, and so on; several files that belong together, also in a list.
    kind : of the data, where the files do not tell.
    scenario, sections : where the kind needs them to read, as `track`.

    Raises
    ------
    InputError : a file is missing, damaged or unknown, or it cannot be told what it holds.
    """
    _, data, _ = opened(paths, scenario, {**sections, **({} if kind is None else {"kind": kind})}, reading=True)
    return data


def info(
    *paths: str | Path | list[str | Path],
    kind: str | None = None,
    scenario: Any = None,
    check: bool = False,
    **sections: Any,
) -> Info:
    """What files hold, what was assumed, and the command that tracks them.

    Parameters
    ----------
    paths, kind, scenario, sections : as `read`.
    check : whether to look closely at the sensor too: of an array, polarity, gain and order of its channels, as far as
        the sources in the recording tell (`faintrack.signal.channels`).

    Raises
    ------
    InputError : as `read`; or there is nothing to check.
    """
    given = {**sections, **({} if kind is None else {"kind": kind})}
    found, data, complete = opened(paths, scenario, given, reading=True)
    remarks = (*getattr(data, "remarks", ()), *(() if complete is None else _checked(found, data, complete)))
    if check:
        remarks = (*remarks, *_closely(found, data, complete))
    files = " ".join(map(str, _paths(paths)))
    needed = "" if isinstance(scenario, str | Path) is False else f" --scenario {scenario}"
    if not needed and found.needs:
        needed = f" {' '.join(found.needs)}"
    return Info(found.name, found.describe(data), tuple(dict.fromkeys(remarks)), f"faintrack track {files}{needed}")


def _checked(kind: Kind, data: Any, scenario: Scenario) -> tuple[str, ...]:
    """What a scenario cannot tell of data, or why it does not fit them."""
    try:
        return kind.plan(data, scenario).checks
    except InputError as error:
        return (str(error),)


def _closely(kind: Kind, data: Any, scenario: Scenario | None) -> tuple[str, ...]:
    """What a close look at the sensor finds."""
    if scenario is None and kind.needs:
        raise InputError(f"{kind.name}: a check needs {' '.join(kind.needs)}.")
    check = None if scenario is None else kind.plan(data, scenario).check
    if check is None:
        raise InputError(f"{kind.name}: there is nothing to check; expected a recording of an array.")
    return check()


def read_result(folder: str | Path) -> Result:
    """Result of a folder that `track` or `Result.save` wrote; its data are read as they are needed.

    Raises
    ------
    InputError : the folder is missing, or is no whole result.
    """
    data, about = read_folder(folder)
    scenario, kind = Scenario.read(Path(folder) / "scenario.toml"), kind_named(about["kind"], folder)
    return Result(data, scenario, kind, about["seconds"], about["remarks"], about["misfits"])


@dataclass(frozen=True)
class Given:
    """Sections of a scenario whose kind the data may have to tell.

    Attributes
    ----------
    sections : by name.
    source : where they come from, for messages.
    folder : that their paths are relative to.
    """

    sections: Mapping[str, Any]
    source: object = None
    folder: Path | None = None

    @property
    def kind(self) -> str | None:
        """Name of the kind that the sections tell."""
        return kind_of_sections(self.sections, self.source)

    def of(self, kind: str) -> Scenario:
        """Scenario of a kind with these sections."""
        return scenario_of({**self.sections, "kind": kind}, self.source, self.folder)


def scenario_given(scenario: Any, sections: Mapping[str, Any]) -> Given:
    """What was given as a scenario, with sections in place of its own.

    Raises
    ------
    InputError : it is no scenario, or a file of it cannot be read.
    """
    if scenario is None:
        return Given(dict(sections))
    if isinstance(scenario, Scenario):
        return Given(merged({**scenario.model_dump(exclude_unset=True), "kind": scenario.kind}, sections))
    if isinstance(scenario, Mapping):
        return Given(merged(scenario, sections))
    if isinstance(scenario, str | Path):
        # Paths in the file are relative to it; those given beside it are relative to where the program runs.
        beside = {
            name: str(Path(value).absolute())
            if name in ("array", "heading") and isinstance(value, str | Path)
            else value
            for name, value in sections.items()
        }
        return Given(merged(read_toml(scenario), beside), scenario, Path(scenario).parent)
    raise InputError(
        f"scenario is a {type(scenario).__name__}; expected the path of a TOML file, a dictionary or a Scenario, "
        "and sections such as the array by their names: track(what, array=...)."
    )


def opened(what: Any, scenario: Any, sections: Mapping[str, Any], reading: bool = False) -> tuple[Kind, Any, Any]:
    """Kind and data of what is given, and the scenario for them.

    Parameters
    ----------
    what, scenario, sections : as `track`.
    reading : whether the scenario may lack what only tracking needs; it is None then where nothing was given.

    Raises
    ------
    InputError : it is not known what the data are, or they do not fit the scenario.
    """
    given = scenario_given(scenario, sections)
    held = next((kind for kind in kinds() if isinstance(what, kind.data)), None)
    paths = () if held is not None else _paths(what)
    said = given.sections.get("kind")
    if held is not None:
        name = given.kind
        if name is not None and held.name != name:
            raise InputError(f"the data are of the kind {held.name} and the scenario of {name}; expected the same.")
        kind = held
    else:
        kind = kind_of_files(paths, given) if said is None else kind_named(str(said), given.source)
    complete = None
    if not reading or given.sections.keys() - {"kind"}:
        with _telling_kind(kind, () if said is not None or given.kind is not None else paths):
            complete = given.of(kind.name)
    return kind, kind.read(paths, complete) if held is None else what, complete


def kind_of_files(paths: tuple[Path, ...], given: Given) -> Kind:
    """The kind of data that files hold.

    Raises
    ------
    InputError : a file may be of several kinds, or of none, or of one that has no such sections.
    """
    listed = ", ".join(map(str, paths))
    holding = [kind for kind in kinds() if kind.holds(paths)]
    able = [kind for kind in holding if set(given.sections) <= set(kind.scenario.model_fields)]
    if len(able) == 1:
        return able[0]
    if able:
        names = " or ".join(kind.name for kind in able)
        raise InputError(f"{listed}: it may hold {names}; expected a scenario with kind = one of them (--kind KIND).")
    # What the sections are of decides where the files do not tell, and is refused where they tell something else.
    name = given.kind
    if name is not None and kind_named(name).takes(paths):
        return kind_named(name)
    if holding:
        kind = holding[0]
        other = next(field for field in given.sections if field not in kind.scenario.model_fields)
        raise InputError(
            f"{listed} holds {kind.name}, of which a scenario has no section {other}; expected "
            f"{', '.join(kind.scenario.model_fields)}, or another kind = ... (--kind KIND)."
        )
    if name is not None:
        return kind_named(name)
    names = ", ".join(kind.name for kind in kinds() if set(given.sections) <= set(kind.scenario.model_fields))
    raise InputError(
        f"{listed}: the name does not tell what it holds; expected a scenario with kind = one of {names} (--kind KIND)."
    )


@contextmanager
def _telling_kind(kind: Kind, paths: tuple[Path, ...]) -> Iterator[None]:
    """Add to a complaint about a scenario what the files were taken for, where they told the kind."""
    try:
        yield
    except InputError as error:
        if not paths:
            raise
        listed = ", ".join(map(str, paths))
        raise InputError(f"{listed} was taken for {kind.name} (kind = ... or --kind changes that): {error}") from error


def _paths(what: Any) -> tuple[Path, ...]:
    """Paths that were given as data.

    Raises
    ------
    InputError : they are no paths, or do not exist.
    """
    given = what if isinstance(what, list | tuple) else (what,)
    several = [path for one in given for path in (one if isinstance(one, list | tuple) else (one,))]
    if not several or not all(isinstance(path, str | Path) for path in several):
        kinds_in_memory = ", ".join(kind.data.__name__ for kind in kinds())
        wrong = next((one for one in several if not isinstance(one, str | Path)), what)
        raise InputError(
            f"what to track is a {type(wrong).__name__}; expected paths, or data in memory ({kinds_in_memory}), which "
            "from_samples, from_frames and their like make of arrays."
        )
    paths = tuple(Path(path) for path in several)
    for path in paths:
        if not path.exists():
            raise InputError(f"{path} does not exist.")
    return paths


def _remarks(kind: Kind, data: Any, plan: Plan, found: xr.Dataset) -> tuple[str, ...]:
    """What a user must know of data, of how they were taken in and what was lost; each sentence once."""
    promised = about_false_tracks(kind, plan.scenario, found)
    return tuple(
        dict.fromkeys((*getattr(data, "remarks", ()), *plan.checks, *plan.remarks(), *_no_room(found), *promised))
    )


def _misfits(kind: Kind, plan: Plan, found: xr.Dataset) -> tuple[str, ...]:
    """Where data are not as the model has them; each sentence once."""
    return tuple(dict.fromkeys((*plan.misfits(), *about_rises(kind, plan.scenario, found))))


def _no_room(found: xr.Dataset) -> tuple[str, ...]:
    """What is said where targets were found and all slots taken."""
    scans = int(found["full"].sum()) if "full" in found else 0
    if not scans:
        return ()
    slots = found.sizes["slot"] - 1
    return (
        f"In {scans} of {found.sizes['time']} scans one more target was found than the {slots} that are followed at "
        "once; raise tracker.targets.",
    )


def _reported(result: Result, file: Path) -> Result:
    """Result whose report is written; a picture that fails is a remark beside a whole result."""
    try:
        result.report(file)
    # Whatever a library of pictures raises: the result is there already.
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        return replace(result, remarks=(*result.remarks, f"The report could not be drawn ({reason})."))
    return result


def _counted(blocks: Iterable[xr.Dataset], plan: Plan, progress: Progress) -> Iterator[xr.Dataset]:
    for block in blocks:
        yield block
        progress(block.sizes.get("time", 0), plan.length)
