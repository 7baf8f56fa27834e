"""How an archive stands: hours that are done, what was left out, what failed."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from faintrack.archive.plan import arranged
from faintrack.archive.store import opened
from faintrack.io.locks import Held, locked


@dataclass(frozen=True)
class StationStatus:
    """How a station stands.

    Attributes
    ----------
    station : its name.
    segments, done : planned, and with a result.
    hours, hours_done : of scans in them.
    tracks : in hand in any of its segments, those that two segments have counted twice.
    took : seconds of workers.
    """

    station: str
    segments: int
    done: int
    hours: float
    hours_done: float
    tracks: int
    took: float


@dataclass(frozen=True)
class Status:
    """How an archive stands.

    Attributes
    ----------
    running : whether a run writes to it.
    stations : how each stands.
    left_out : files that were passed over, and why.
    failed : segments without a result, and why.
    """

    running: bool
    stations: tuple[StationStatus, ...]
    left_out: dict[str, str]
    failed: dict[str, str]

    @property
    def whole(self) -> bool:
        """Whether every segment that is planned has a result."""
        return all(station.done == station.segments for station in self.stations)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for programs."""
        return {**asdict(self), "whole": self.whole}


def status(path: str | Path) -> Status:
    """How an archive stands.

    Parameters
    ----------
    path : of the store.

    Raises
    ------
    InputError : there is no store.
    """
    store = opened(path)
    pieces = [piece for piece in store.pieces if piece.paths[0] not in store.left_out]
    plan = arranged(pieces, (), store.path / "scenarios" / "{station}.toml", store.cut)
    stations = []
    for facts in plan.stations:
        mine = [segment for chain in plan.chains for segment in chain if segment.station == facts.station]
        kept = {segment.name: store.segment(segment.name) for segment in mine}
        done = {
            segment.name: found
            for segment in mine
            if (found := kept[segment.name]) is not None and found["fingerprint"] == segment.fingerprint
        }
        stations.append(
            StationStatus(
                facts.station,
                len(mine),
                len(done),
                sum(segment.seconds for segment in mine) / 3600,
                sum(found["seconds"] for found in done.values()) / 3600,
                sum(found["tracks"] for found in done.values()),
                sum(found["took"] for found in done.values()),
            )
        )
    return Status(
        _is_running(store.path), tuple(stations), {path: why for path, _, why in store.left_out.values()}, store.failed
    )


def _is_running(path: Path) -> bool:
    try:
        with locked(path / ".lock", keep=True):
            return False
    except (Held, OSError):
        return True
