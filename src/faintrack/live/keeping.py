"""The folder of a watch: what came out, part by part, and where the run stands.

.. code-block:: text

    20260101T220000Z.jsonl   one line a scan or event, written as they come
    20260101T220000Z/        a result of the same time, whole; see `faintrack.results.folder`
    state/                   where the run stands: written every minute, and at the end

A part lasts an hour at most. Its result grows under a hidden name and is renamed when it is whole, which a clean end
sees to, or the next run where there was none; its lines are on the disk as they are written. The state is written
beside the older one and takes its place at once: a process that is killed at any moment leaves one or the other.
"""

import json
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from jaxtyping import Float

from faintrack.errors import InputError
from faintrack.io.locks import Held, locked
from faintrack.kinds import kind_named
from faintrack.kinds.door import Moment
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import Checkpoint, load_checkpoint, save_checkpoint
from faintrack.kinds.scenario import Scenario
from faintrack.live.lines import line
from faintrack.live.watching import Watching
from faintrack.results.folder import (
    CHUNK,
    MARK,
    PARTIAL,
    make_folder,
    open_blocks,
    replaced,
    result_folder,
    write_blocks,
    write_rest,
)
from faintrack.results.result import Result

PART = 3600.0
"""Seconds of a part."""

SAVED = 60.0
"""Seconds between two states."""

_STATE, _FACTS, _OPENING, _SCENARIO = "state", "facts.json", "opening.npy", "scenario.toml"


@dataclass(frozen=True)
class Since:
    """Where an earlier run stopped.

    Attributes
    ----------
    scans : its scans.
    opening : samples that its plan was made from; None where its data can be read again.
    facts : what else was saved, by name.
    checkpoint : file of the state.
    scenario : what was run, with what was chosen for the data.
    """

    scans: int
    opening: Float[np.ndarray, "sample channel"] | None
    facts: Mapping[str, Any]
    checkpoint: Path
    scenario: Scenario

    @property
    def start_time(self) -> np.datetime64 | None:
        """Of the first sample of the watch; None where it is not known."""
        start = self.facts["start_time"]
        return None if start is None else np.datetime64(start, "ns")

    def load(self, plan: Plan) -> Checkpoint:
        """State for a plan of the same data and scenario.

        Raises
        ------
        InputError : it is of another scenario.
        """
        return replace(load_checkpoint(self.checkpoint, plan), scans=self.scans)


@dataclass
class Keeping:
    """A folder while it is written; a context manager, one process at a time.

    Attributes
    ----------
    folder : of the watch.
    seconds : of a part.
    """

    folder: Path
    seconds: float = PART
    _open: ExitStack = field(default_factory=ExitStack)
    _lines: Any = None
    _saved: float = 0.0
    _whole: bool = False

    def __enter__(self) -> "Keeping":
        folder = self.folder
        if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
            raise InputError(f"{folder} is no folder; expected one for --out.")
        known = not folder.exists() or (folder / _STATE).is_dir() or not any(folder.iterdir())
        if not known:
            raise InputError(f"{folder} exists and is no folder of faintrack live; expected another name for --out.")
        make_folder(folder / _STATE)
        try:
            self._open.enter_context(locked(folder / ".lock"))
        except Held as error:
            raise InputError(f"{folder} is being written by another run; expected another name for --out.") from error
        except OSError as error:
            raise InputError(f"{folder} cannot be written ({error.strerror}).") from error
        for partial in folder.glob(f".*{PARTIAL}"):
            if (partial / MARK).is_file() and not partial.is_symlink():
                self._finish(partial)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close_lines()
        self._open.close()

    def since(self) -> Since | None:
        """Where an earlier run stopped; None where there was none.

        Raises
        ------
        InputError : its state is damaged.
        """
        state = self.folder / _STATE
        if not (state / _FACTS).exists():
            return None
        try:
            facts = json.loads((state / _FACTS).read_text(encoding="utf-8"))
            beginning = state / _OPENING
            return Since(
                int(facts["scans"]),
                np.load(beginning, allow_pickle=False) if beginning.exists() else None,
                dict(facts["more"]),
                state / str(Path(facts["checkpoint"]).name),
                Scenario.read(state / _SCENARIO),
            )
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"{state} is damaged ({type(error).__name__}); expected another name for --out."
            ) from error

    @property
    def state(self) -> Path:
        """Folder of what a later run needs."""
        return self.folder / _STATE

    def save_beginning(self, watch: Watching) -> None:
        """Keep what the plan was made from and chose."""
        replaced(self.state / _SCENARIO, watch.plan.scenario.save)
        opening = watch.opening
        if opening is not None:
            replaced(self.state / _OPENING, lambda path: _save_array(path, opening))

    def save(self, watch: Watching, more: Mapping[str, Any]) -> None:
        """Write where the run stands.

        Parameters
        ----------
        watch : as it stands.
        more : plain values that are wanted when it goes on, beside those of the watch.
        """
        state, checkpoint = self.state, watch.checkpoint
        if checkpoint is None:
            return
        name = f"{checkpoint.scans}.state"
        replaced(state / name, lambda path: save_checkpoint(path, checkpoint))
        facts = {"scans": checkpoint.scans, "checkpoint": name, "more": {**watch.facts(), **more}}
        replaced(state / _FACTS, lambda path: path.write_text(json.dumps(facts), encoding="utf-8"))
        for older in state.glob("*.state"):
            if older.name != name:
                older.unlink(missing_ok=True)
        self._saved = time.monotonic()

    def due(self) -> bool:
        """Whether a minute has passed since the state was written."""
        return time.monotonic() - self._saved > SAVED

    def tell(self, event: Mapping[str, Any]) -> None:
        """Add an event to the lines of the part that is open.

        Raises
        ------
        InputError : it cannot be written.
        """
        try:
            # What is told between two parts, or at the end, belongs to the one before.
            if self._whole and event["event"] == "scan":
                self._close_lines()
            if self._lines is None:
                self._lines = (self.folder / f"{self._name()}.jsonl").open("a", encoding="utf-8")
            self._lines.write(line(event) + "\n")
            self._lines.flush()
        except OSError as error:
            raise InputError(f"{self.folder} cannot be written ({error.strerror}).") from error

    def part(self, watch: Watching, moments: Iterator[Moment], first: Moment) -> Path:
        """Write the result of an hour of scans, or of those up to the end.

        Parameters
        ----------
        watch : whose scans they are.
        moments : scans that follow `first`, taken from as they come.
        first : scan of the part.

        Raises
        ------
        InputError : it cannot be written.
        """
        begun, name = time.monotonic(), self._name()

        def blocks() -> Iterator[Any]:
            last = first
            yield first.data
            for moment in moments:
                last = moment
                yield moment.data
                if moment.time - first.time >= self.seconds:
                    break
            closed = watch.close(last.checkpoint.state)
            if closed is not None:
                yield closed

        with result_folder(self.folder / name) as folder:
            write_blocks(folder, blocks())
            seconds, data = time.monotonic() - begun, open_blocks(folder)
            write_rest(folder, Result(data, watch.plan.scenario, watch.kind, seconds, watch.remarks(), watch.misfits()))
        self._whole = True
        return self.folder / name

    def _finish(self, partial: Path) -> None:
        """Make a whole result of what a run that was killed has left, or remove it where it holds nothing whole."""
        import zarr

        name = partial.name[1 : -len(PARTIAL)].rpartition(".")[0]
        try:
            zarr.consolidate_metadata(partial / "result.zarr")
            scenario = Scenario.read(self.folder / _STATE / _SCENARIO)
            said = (f"The run was killed; scans since the last {CHUNK} are in {name}.jsonl alone.",)
            write_rest(partial, Result(open_blocks(partial), scenario, kind_named(scenario.kind), 1.0, said))
            (partial / MARK).unlink()
            partial.replace(self.folder / name)
        # Whatever a store that was cut short raises: its lines are there.
        except Exception:
            shutil.rmtree(partial, ignore_errors=True)

    def _name(self) -> str:
        """Of the part that is open: that of its lines, which begin with the first event."""
        if self._lines is not None:
            return Path(self._lines.name).stem
        name = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        # Two parts may begin in one second.
        taken = {path.stem for path in self.folder.iterdir()}
        return next(one for one in (name, *(f"{name}-{number}" for number in range(2, 10_000))) if one not in taken)

    def _close_lines(self) -> None:
        if self._lines is not None:
            self._lines.close()
            self._lines, self._whole = None, False


def _save_array(path: Path, values: np.ndarray) -> None:
    with path.open("wb") as file:
        np.save(file, values)
