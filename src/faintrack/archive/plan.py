"""What an archive consists of and how it will be computed: hours, gaps, overlaps, bytes, chains of segments."""

import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from itertools import groupby, islice, pairwise
from pathlib import Path
from typing import Any

from faintrack.archive.cut import OPENING, Cut, Segment, chains_of
from faintrack.archive.pieces import SECOND, LeftOut, Piece, laid, pieces_of
from faintrack.archive.samples import Samples
from faintrack.archive.segment import taken_in
from faintrack.archive.sources import STATION, sources_of
from faintrack.archive.store import Store
from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.kinds.door import scenario_given
from faintrack.kinds.loop import Checkpoint

BLOCKS = 5
"""Blocks of scans that a trial takes in, the first of which compiles."""

Progress = Callable[[int, int | None], None]


@dataclass(frozen=True)
class StationFacts:
    """What is there of a station.

    Attributes
    ----------
    station : its name.
    files : that are read.
    start, stop : of its recordings; ns since 1970.
    hours : of samples.
    gaps, gap_hours : between recordings.
    overlaps, overlap_s : what was recorded twice, and is read once.
    channels, sample_rate : of all its recordings.
    size : bytes of its files.
    segments : to be computed in all, in `chains`.
    """

    station: str
    files: int
    start: int
    stop: int
    hours: float
    gaps: int
    gap_hours: float
    overlaps: int
    overlap_s: float
    channels: int
    sample_rate: float
    size: int
    segments: int
    chains: int


@dataclass(frozen=True)
class ArchivePlan:
    """How an archive will be computed.

    Attributes
    ----------
    chains : of all stations, earliest first.
    stations : what is there of each.
    left_out : files that are passed over: path, stamp, reason.
    pieces : files as their headers are.
    scenarios : what is run, by station.
    """

    chains: tuple[tuple[Segment, ...], ...]
    stations: tuple[StationFacts, ...]
    left_out: tuple[LeftOut, ...]
    pieces: tuple[Piece, ...]
    scenarios: dict[str, Any]

    @property
    def seconds(self) -> float:
        """Of all scans, those of burn-ins too."""
        return sum(segment.seconds for chain in self.chains for segment in chain)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for programs."""
        left_out = [{"path": path, "reason": reason} for path, _, reason in self.left_out]
        return {"stations": [asdict(station) for station in self.stations], "left_out": left_out}


def planned(
    given: Iterable[str | Path],
    scenario: Any,
    cut: Cut | None = None,
    pattern: str | None = None,
    store: Store | None = None,
    retry: bool = False,
    progress: Progress = lambda done, total: None,
) -> ArchivePlan:
    """Plan of an archive.

    Parameters
    ----------
    given, pattern : see `faintrack.archive.sources.sources_of`.
    scenario : as of `faintrack.track`; `{station}` in its path stands for the station's name.
    cut : how time is cut, where there is no store.
    store : whose files belong to the archive too, and whose files that were left out stay so until they change.
    retry : whether those are looked at again.
    progress : is called while headers are read.

    Raises
    ------
    InputError : there is no recording, or scenario or pattern cannot be used.
    """
    sources, misnamed = sources_of(given, pattern)
    known = {} if store is None else {piece.paths: piece for piece in store.pieces}
    before = {} if store is None or retry else store.left_out
    pieces, unreadable = pieces_of(sources, before, known, progress)
    read = {piece.paths: piece for piece in pieces}
    listed = {source.paths[0] for source in sources}
    left_out = [*((path, "", why) for path, why in misnamed), *unreadable]
    left_out += [one for path, one in before.items() if path not in listed]
    refused = {path for path, _, _ in left_out}
    everything = {paths: piece for paths, piece in (known | read).items() if paths[0] not in refused}
    if not everything:
        path, _, why = left_out[0]
        raise InputError(f"{path}: {why}; of {len(left_out)} files none can be read.")
    cut = (Cut() if cut is None else cut) if store is None else store.cut
    return arranged(list(everything.values()), left_out, scenario, cut)


def arranged(pieces: Iterable[Piece], left_out: Iterable[LeftOut], scenario: Any, cut: Cut) -> ArchivePlan:
    """Plan of files whose headers are known; see `planned`."""
    chains: list[tuple[Segment, ...]] = []
    stations, scenarios, out = [], {}, list(left_out)
    ordered = sorted(pieces, key=lambda piece: (piece.station, piece.begin, piece.paths))
    for station, group in groupby(ordered, key=lambda piece: piece.station):
        on_clock, refused = laid(group)
        out += refused
        what = scenarios[station] = scenario_for(scenario, station)
        opening = max(OPENING, (what.likelihood.noise_seconds or 0) + what.analysis.frame)
        mine = chains_of(on_clock, cut, what.analysis.frame, opening)
        chains += mine
        stations.append(_facts(on_clock, mine))
    chains.sort(key=lambda chain: (chain[0].start, chain[0].station))
    return ArchivePlan(tuple(chains), tuple(stations), tuple(out), tuple(ordered), scenarios)


def scenario_for(scenario: Any, station: str) -> Any:
    """What is run with the recordings of a station.

    Raises
    ------
    InputError : it is no scenario of recordings.
    """
    if isinstance(scenario, str | Path) and STATION in str(scenario):
        scenario = str(scenario).replace(STATION, station)
    given = scenario_given(scenario, {})
    if given.kind not in (None, "recording"):
        raise InputError(f"the scenario is of {given.kind}; an archive is of recordings.")
    what: Any = given.of("recording")
    if what.array is None:
        raise InputError(f"{station}: no array was given; expected [array] in the scenario.")
    return what


def trial(segment: Segment, scenario: Any) -> float:
    """Seconds that a second of a segment's recording takes one process, compiling apart.

    Raises
    ------
    InputError : recording and scenario do not fit together.
    """
    with Samples(segment) as samples:
        plan = kind_named("recording").plan(samples.recording(), scenario)
        first, stop = segment.ranges[-1]
        stop = min(stop, first + BLOCKS * plan.size)
        moments = taken_in(plan, Checkpoint(plan.state, 0), ((first, stop),))
        (compiled, _), *_ = islice(moments, 1)
        began = time.perf_counter()
        for _ in moments:
            pass
        scans = stop - compiled.scans
        taken = scans * segment.frame / segment.pieces[0].sample_rate
        return (time.perf_counter() - began) / taken if scans else 0.0


def _facts(pieces: list[Piece], chains: list[tuple[Segment, ...]]) -> StationFacts:
    gaps = [after.begin - before.end for before, after in pairwise(pieces) if after.begin > before.end]
    overlaps = [piece.overlap / piece.sample_rate for piece in pieces if piece.overlap]
    first = pieces[0]
    return StationFacts(
        first.station,
        sum(len(piece.paths) for piece in pieces),
        first.begin,
        pieces[-1].end,
        sum(piece.length / piece.sample_rate for piece in pieces) / 3600,
        len(gaps),
        sum(gaps) / SECOND / 3600,
        len(overlaps),
        sum(overlaps),
        len(first.channel_names),
        first.sample_rate,
        sum(piece.size for piece in pieces),
        sum(map(len, chains)),
        len(chains),
    )
