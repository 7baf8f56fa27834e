"""An archive from its files to its tables: planned, computed on Dask, joined; gone on with where it stopped.

Within a chain a segment waits for the one before it; chains do not wait for each other. A file that turns out to be
damaged, changed or gone is left out: when all else is done the archive is planned again without it, and what depends on
it is computed anew. So a result never depends on when a file went bad, only on which files were read.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faintrack.archive.cut import Cut, Segment
from faintrack.archive.joining import join
from faintrack.archive.plan import ArchivePlan, Progress, arranged, planned
from faintrack.archive.remote import is_there
from faintrack.archive.segment import Outcome, compute
from faintrack.archive.sources import placed
from faintrack.archive.status import Status, status
from faintrack.archive.store import Store, writing
from faintrack.archive.tables import parquet
from faintrack.errors import InputError
from faintrack.studies.running import connect

if TYPE_CHECKING:
    from distributed import Client

WAITING = 2
"""Segments for each worker that are computed or wait for it."""

Tell = Callable[[str], None]


def run(
    scenario: Any,
    sources: Iterable[str | Path],
    out: str | Path,
    *,
    pattern: str | None = None,
    cut: Cut | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    retry: bool = False,
    progress: Progress = lambda done, total: None,
    tell: Tell = lambda sentence: None,
) -> Status:
    """Track an archive, or what of it is not done yet.

    Parameters
    ----------
    scenario : as of `faintrack.track`; `{station}` in its path stands for the station's name.
    sources : folders, files, patterns, lists or addresses; see `faintrack.archive.sources`.
    out : folder of the store; files that it knows belong to the archive too.
    pattern : how paths tell station and start.
    cut : of a new store.
    workers : processes on this machine, one a core where not given; 0 for this process alone, whose bits are others
        than those of workers, which have one thread each.
    scheduler : address of a Dask scheduler whose workers see the files and the store by the same paths.
    retry : whether files that were left out are looked at again.
    progress : is called with the seconds of recordings that were taken in just now, and of all that are missing.
    tell : is called with each sentence of what was left out or failed.

    Raises
    ------
    InputError : sources, scenario or store cannot be used, or no scheduler answers.
    """
    parquet()
    given = [placed(source) for source in sources]
    with writing(out, cut) as store:
        plan = planned(given, scenario, None, pattern, store, retry)
        for station, what in plan.scenarios.items():
            store.keep_scenario(station, what)
        store.keep_pieces(plan.pieces)
        store.keep_facts(sources=given, pattern=pattern)
        _keep_left_out(store, plan, tell)
        store.keep_failed({})
        missing = _missing(store, plan)
        total = round(sum(segment.seconds for chain in missing for segment in chain))
        client: Any = nullcontext() if workers == 0 or not missing else connect(workers, scheduler)
        with client as at:
            while missing:
                before = set(store.left_out)
                for outcome in outcomes(at, str(store.path.absolute()), missing):
                    _take(store, outcome, tell)
                    progress(round(outcome.seconds), total)
                bad = set(store.left_out) - before
                if not bad:
                    break
                rest = [piece for piece in plan.pieces if piece.paths[0] not in store.left_out]
                plan = arranged(rest, store.left_out.values(), scenario, store.cut)
                missing = _missing(store, plan)
        _remove_stale(store, plan)
        join(store)
    return status(out)


def retry(out: str | Path, **options: Any) -> Status:
    """Look at files that were left out again, and compute what failed or is missing.

    Parameters
    ----------
    out : folder of the store.
    options : `workers`, `scheduler`, `progress`, `tell` of `run`.

    Raises
    ------
    InputError : there is no such store, or as `run`.
    """
    from faintrack.archive.store import opened

    store = opened(out)
    facts = store.facts
    if "sources" not in facts:
        raise InputError(f"{store.path} was never planned; expected faintrack archive run.")
    return run(
        store.path / "scenarios" / "{station}.toml",
        facts["sources"],
        store.path,
        pattern=facts["pattern"],
        retry=True,
        **options,
    )


def outcomes(client: "Client | None", store: str, chains: Iterable[tuple[Segment, ...]]) -> Iterator[Outcome]:
    """Compute segments; yields what becomes of each, chains stop where a segment has no result.

    Parameters
    ----------
    client : of Dask; None to compute here.
    store : folder of the store.
    chains : segments to be computed, those of a chain in their order.

    Raises
    ------
    InputError : the scheduler went away.
    """
    if client is None:
        for chain in chains:
            for segment in chain:
                outcome = compute(store, segment)
                yield outcome
                if not outcome.done:
                    break
        return
    yield from _on_workers(client, store, chains)


def _on_workers(client: "Client", store: str, chains: Iterable[tuple[Segment, ...]]) -> Iterator[Outcome]:
    from distributed import KilledWorker, as_completed
    from distributed.client import FutureCancelledError

    waiting = deque(deque(chain) for chain in chains)
    started: dict[Any, tuple[Segment, deque[Segment]]] = {}

    def submit(chain: deque[Segment]) -> Any:
        segment = chain.popleft()
        future = client.submit(compute, store, segment, pure=False)
        started[future] = segment, chain
        return future

    count = WAITING * max(1, len(client.scheduler_info()["workers"]))
    completed = as_completed([submit(waiting.popleft()) for _ in range(min(count, len(waiting)))])
    for future in completed:
        segment, chain = started.pop(future)
        try:
            outcome: Outcome = future.result()
        except KilledWorker:
            outcome = Outcome(segment.name, failed="every worker that took it died, most likely for want of memory")
        except FutureCancelledError as error:
            raise InputError("the scheduler went away. What is done is kept; run again to go on.") from error
        # Whatever a reader or a tracker raises: the rest goes on.
        except Exception as error:
            outcome = Outcome(segment.name, failed=f"{type(error).__name__}: {' '.join(str(error).split())[:300]}")
        future.release()
        yield outcome
        if outcome.done and chain:
            completed.add(submit(chain))
        elif waiting:
            completed.add(submit(waiting.popleft()))


def _missing(store: Store, plan: ArchivePlan) -> list[tuple[Segment, ...]]:
    """Segments without a result, by chain."""
    lacking = (tuple(segment for segment in chain if not store.done(segment)) for chain in plan.chains)
    return [chain for chain in lacking if chain]


def _take(store: Store, outcome: Outcome, tell: Tell) -> None:
    """Keep what became of a segment."""
    if outcome.done and outcome.segment in store.failed:
        store.keep_failed({name: why for name, why in store.failed.items() if name != outcome.segment})
    vanished = _vanished_since(store, outcome)
    if vanished is not None:
        outcome = replace(outcome, left_out=None, failed=vanished)
    if outcome.left_out is not None and outcome.left_out[0] not in store.left_out:
        # Two chains may have come upon it.
        store.keep_left_out([*store.left_out.values(), outcome.left_out])
        tell(f"{outcome.left_out[0]} is left out: {outcome.left_out[2]}.")
    elif outcome.failed is not None:
        store.keep_failed(store.failed | {outcome.segment: outcome.failed})
        tell(f"{outcome.segment} has no result: {outcome.failed}")


def _vanished_since(store: Store, outcome: Outcome) -> str | None:
    """What is said of a file that is gone but of which there are results: these stay as they are."""
    if outcome.left_out is None:
        return None
    path = outcome.left_out[0]
    if not is_there(path) and any(path in file["paths"] for facts in store.segments() for file in facts["files"]):
        return f"{path} has vanished, of which segments before have results; expected it where it was."
    return None


def _keep_left_out(store: Store, plan: ArchivePlan, tell: Tell) -> None:
    before = store.left_out
    store.keep_left_out(plan.left_out)
    for one in plan.left_out:
        if before.get(one[0]) != one:
            tell(f"{one[0]} is left out: {one[2]}.")


def _remove_stale(store: Store, plan: ArchivePlan) -> None:
    """Remove segments of planned stations that are planned no longer: their files were left out since."""
    import shutil

    wanted = {segment.name for chain in plan.chains for segment in chain}
    stations = {segment.station for chain in plan.chains for segment in chain}
    for facts in store.segments():
        if facts["station"] in stations and facts["name"] not in wanted:
            shutil.rmtree(store.path / "segments" / facts["name"])
