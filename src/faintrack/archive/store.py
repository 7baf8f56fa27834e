"""The store of an archive: what is kept, written once, and open to every program that reads Parquet.

.. code-block:: text

    archive.json                         how it is cut, format, versions, sources
    scenarios/STATION.toml               what is run
    files.parquet                        the files of the archive: station, time, channels, stamp
    left_out.json                        files that were passed over, and why
    failed.json                          segments without a result, and why
    segments/STATION/TIME/               what a worker leaves; see `faintrack.archive.segment`
    states/station=STATION/day=DAY/*     one row a track and scan, tracks joined over seams
    tracks/station=STATION/day=DAY/*     one row a track and day
    report.html                          see `faintrack.archive.report`

One run at a time writes; the system drops its lock with the process. What is renamed into place is whole.
"""

import json
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from faintrack.archive.cut import Cut, Segment
from faintrack.archive.pieces import LeftOut, Piece
from faintrack.archive.tables import read_files, write_files
from faintrack.errors import InputError
from faintrack.io.locks import Held, locked
from faintrack.kinds.scenario import Scenario
from faintrack.results.folder import PARTIAL, flush_files, replaced

FORMAT = 1
"""Of the store; another is not read."""

ARCHIVE, SEGMENT = "archive.json", "segment.json"


@dataclass(frozen=True)
class Store:
    """The folder of an archive.

    Attributes
    ----------
    path : of the folder.
    cut : how the archive is cut.
    """

    path: Path
    cut: Cut

    @property
    def facts(self) -> dict[str, Any]:
        """What `archive.json` tells."""
        return _read_json(self.path / ARCHIVE, {})

    @property
    def pieces(self) -> list[Piece]:
        """Files of the archive as their headers were, as recorded."""
        file = self.path / "files.parquet"
        return read_files(file) if file.exists() else []

    @property
    def left_out(self) -> dict[str, LeftOut]:
        """Files that were passed over, by path."""
        return {path: (path, *why) for path, why in _read_json(self.path / "left_out.json", {}).items()}

    @property
    def failed(self) -> dict[str, str]:
        """Segments without a result, and why."""
        return _read_json(self.path / "failed.json", {})

    def keep_pieces(self, pieces: Iterable[Piece]) -> None:
        """Write the files of the archive."""
        replaced(self.path / "files.parquet", lambda file: write_files(file, pieces))

    def keep_left_out(self, left_out: Iterable[LeftOut]) -> None:
        """Write which files are passed over."""
        self._keep("left_out.json", {path: [mark, reason] for path, mark, reason in sorted(left_out)})

    def keep_failed(self, failed: Mapping[str, str]) -> None:
        """Write which segments have no result."""
        self._keep("failed.json", dict(sorted(failed.items())))

    def keep_facts(self, **facts: Any) -> None:
        """Add to what `archive.json` tells."""
        self._keep(ARCHIVE, {**self.facts, **facts})

    def scenario(self, station: str) -> Any:
        """What is run with the recordings of a station."""
        return Scenario.read(self.path / "scenarios" / f"{station}.toml")

    def keep_scenario(self, station: str, scenario: Scenario) -> None:
        """Write what is run with the recordings of a station.

        Raises
        ------
        InputError : segments were computed with another.
        """
        file = self.path / "scenarios" / f"{station}.toml"
        text = scenario.to_toml()
        if file.exists() and file.read_text(encoding="utf-8") != text:
            raise InputError(f"{self.path} was made with another scenario of {station}, {file}; give another --out.")
        file.parent.mkdir(exist_ok=True)
        replaced(file, lambda beside: beside.write_text(text, encoding="utf-8"))

    def segment(self, name: str) -> dict[str, Any] | None:
        """What is known of a segment with a result; None where there is none."""
        return _read_json(self.path / "segments" / name / SEGMENT, None)

    def done(self, segment: Segment) -> bool:
        """Whether a segment has a result, of these very inputs."""
        facts = self.segment(segment.name)
        return facts is not None and facts["fingerprint"] == segment.fingerprint

    def segments(self) -> Iterator[dict[str, Any]]:
        """What is known of all segments with a result, by station and time."""
        for file in sorted(self.path.glob(f"segments/*/*/{SEGMENT}")):
            facts = _read_json(file, None)
            if facts is not None:
                yield facts | {"name": f"{file.parent.parent.name}/{file.parent.name}"}

    def _keep(self, name: str, content: Any) -> None:
        text = json.dumps(content, indent=2) + "\n"
        replaced(self.path / name, lambda beside: beside.write_text(text, encoding="utf-8"))


def opened(path: str | Path) -> Store:
    """Store of an archive, to read.

    Raises
    ------
    InputError : there is none, or another version made it.
    """
    path = Path(path)
    facts = _read_json(path / ARCHIVE, None)
    if facts is None:
        raise InputError(f"{path} has no {ARCHIVE}; expected the folder of faintrack archive run --out.")
    theirs, ours = (facts.get("version"), facts.get("format")), (version("faintrack"), FORMAT)
    if theirs != ours:
        raise InputError(
            f"{path} is of faintrack {theirs[0]}, format {theirs[1]}; this is {ours[0]}, format {ours[1]}, whose "
            "results may differ. Give another --out."
        )
    return Store(path, Cut(**facts["cut"]))


@contextmanager
def writing(path: str | Path, cut: Cut | None = None) -> Iterator[Store]:
    """Store of an archive while a run writes to it; made where it is not there.

    Parameters
    ----------
    path : of the folder.
    cut : how a new store is cut; that of an older one where None.

    Raises
    ------
    InputError : another run writes to it, it holds something else, was cut otherwise, or cannot be written.
    """
    path = Path(path)
    with ExitStack() as held:
        try:
            path.mkdir(parents=True, exist_ok=True)
            strangers = [entry.name for entry in path.iterdir() if entry.name != ".lock"]
            if strangers and not (path / ARCHIVE).exists():
                raise InputError(
                    f"{path} holds {min(strangers)} and no {ARCHIVE}; expected an empty folder or a store."
                )
            held.enter_context(locked(path / ".lock", keep=True))
        except Held as error:
            raise InputError(f"{path} is in use by another run; wait for its end or give another --out.") from error
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}).") from error
        if not (path / ARCHIVE).exists():
            store = Store(path, Cut() if cut is None else cut)
            store.keep_facts(format=FORMAT, version=version("faintrack"), cut=asdict(store.cut))
        store = opened(path)
        if cut is not None and cut != store.cut:
            raise InputError(f"{path} is cut as {asdict(store.cut)}; {asdict(cut)} was asked for. Give another --out.")
        for partial in path.glob(f"segments/*/.*{PARTIAL}"):
            shutil.rmtree(partial, ignore_errors=True)
        yield store


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Yield a folder beside a place, which takes the place when the block ends and all of it is on the disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=PARTIAL, dir=path.parent))
    try:
        yield partial
        flush_files(partial)
        partial.chmod(0o755)
        if path.exists():
            # Of other inputs: first it is none any longer, then its files go.
            (path / SEGMENT).unlink(missing_ok=True)
            shutil.rmtree(path)
        partial.replace(path)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _read_json(path: Path, otherwise: Any) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return otherwise
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read ({error}).") from error
