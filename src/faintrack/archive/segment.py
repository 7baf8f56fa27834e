"""What a worker does: one segment from its files to its folder.

.. code-block:: text

    segments/STATION/20260101T060000Z/
        segment.json     provenance: files, what they held, what was left out, versions, what it took
        states.parquet   one row a track and scan; labels count within the chain
        seam.state       where the tracker stands at the end; the next segment goes on from it
        scenario.toml    what was run, with what was chosen for the data
        report.html      for a person

The folder is written beside its place and renamed when it is on the disk.
"""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from faintrack.archive.cut import Segment
from faintrack.archive.samples import ReadAhead, Samples, Unreadable
from faintrack.archive.store import SEGMENT, whole_folder
from faintrack.archive.tables import states_of, write_table
from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import Checkpoint, advance, load_checkpoint, save_checkpoint
from faintrack.kinds.scenario import Scenario
from faintrack.numerics.compiled import keep_compilations
from faintrack.results.folder import versions
from faintrack.results.result import Result
from faintrack.results.schema import joined

STATE = "seam.state"
"""File of the tracker's state at the end of a segment."""


@dataclass(frozen=True)
class Outcome:
    """What became of a segment.

    Attributes
    ----------
    segment : its name.
    seconds : of scans that were taken in.
    took : seconds that it took.
    left_out : path, stamp and reason of a file that cannot be read; the segment is to be planned again without it.
    failed : why there is no result otherwise.
    """

    segment: str
    seconds: float = 0.0
    took: float = 0.0
    left_out: tuple[str, str, str] | None = None
    failed: str | None = None

    @property
    def done(self) -> bool:
        """Whether there is a result."""
        return self.left_out is None and self.failed is None


def compute(store: str, segment: Segment) -> Outcome:
    """Compute a segment and write its folder.

    Parameters
    ----------
    store : folder of the archive.
    segment : whose segment before is done.
    """
    began = time.perf_counter()
    try:
        _compute(Path(store), segment, began)
    except Unreadable as error:
        return Outcome(segment.name, left_out=(error.piece.paths[0], " ".join(error.piece.stamps), error.reason))
    except (InputError, OSError) as error:
        return Outcome(segment.name, failed=" ".join(str(error).split()))
    return Outcome(segment.name, segment.seconds, time.perf_counter() - began)


def _compute(store: Path, segment: Segment, began: float) -> None:
    keep_compilations()
    scenario: Any = Scenario.read(store / "scenarios" / f"{segment.station}.toml")
    kind = kind_named(scenario.kind)
    with Samples(segment) as samples:
        plan = kind.plan(samples.recording(), scenario)
        since = Checkpoint(plan.state, 0)
        if segment.before is not None:
            since = load_checkpoint(store / "segments" / segment.before / STATE, plan)
        last, blocks = since, []
        for moment in taken_in(plan, since, segment.ranges, samples):
            last = moment[0]
            blocks.append(moment[1])
        samples.require_unchanged()
    data = joined(blocks)
    took = time.perf_counter() - began
    remarks = tuple(dict.fromkeys((*plan.checks, *plan.remarks())))
    result = Result(data, plan.scenario, kind, took, remarks, plan.misfits())
    with whole_folder(store / "segments" / segment.name) as folder:
        save_checkpoint(folder / STATE, last)
        write_table(folder / "states.parquet", states_of(data))
        plan.scenario.save(folder / "scenario.toml")
        facts = _provenance(segment, samples, result, plan.within)
        (folder / SEGMENT).write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
        result.report(folder / "report.html")


def taken_in(
    plan: Plan, since: Checkpoint, ranges: tuple[tuple[int, int], ...], samples: Samples | None = None
) -> Iterator[tuple[Checkpoint, xr.Dataset]]:
    """Ranges of scans through a plan; what lies between them is passed over.

    Parameters
    ----------
    plan : of a chain.
    since : where the run stands.
    ranges : first scan of each, and the one after its last.
    samples : whose digest takes in what is read.
    """
    with ReadAhead(plan.read) as ahead:
        for first, stop in ranges:

            def read(start: int, end: int, stop: int = stop) -> Any:
                block = ahead(start, end, stop)
                if samples is not None:
                    samples.digest.update(np.ascontiguousarray(block[1]).data)
                return block

            part = replace(plan, length=stop, read=read)
            for moment in advance(part, replace(since, scans=first)):
                since = moment[0]
                yield moment


def _provenance(segment: Segment, samples: Samples, result: Result, within: float) -> dict[str, Any]:
    return {
        "fingerprint": segment.fingerprint,
        "station": segment.station,
        "start": segment.start,
        "stop": segment.stop,
        "chain": segment.chain,
        "origin": segment.origin,
        "ranges": segment.ranges,
        "frame_s": segment.frame / segment.pieces[0].sample_rate,
        "before": segment.before,
        "within": within,
        "reference": result.data.bearing.attrs["reference"],
        "tracks": len(result.tracks),
        "files": [{"paths": piece.paths, "stamps": piece.stamps, "begin": piece.begin} for piece in segment.pieces],
        "samples": samples.digest.hexdigest(),
        "bytes_read": round(samples.bytes_read),
        "seconds": segment.seconds,
        "took": round(result.seconds, 3),
        "remarks": result.remarks,
        "misfits": result.misfits,
        **versions(),
    }
