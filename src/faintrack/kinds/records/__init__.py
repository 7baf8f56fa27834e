"""Records: energies of the beams of several arrays, or of one by itself, tracked in the plane or in bearing.

Records of all arrays are put on one time axis (`faintrack.data.records`), detectors search a region and hand over to
particles, one set for each target (`faintrack.trackers.several`). Recordings are beamformed first.
"""

from pathlib import Path

import numpy as np

from faintrack.data.recording import Recording
from faintrack.data.sequence import Sequence
from faintrack.kinds.kind import Kind
from faintrack.kinds.records.data import Records
from faintrack.kinds.records.sections import RecordsScenario
from faintrack.kinds.rooms import room


def _holds(paths: tuple[Path, ...]) -> bool:
    if not all(path.suffix.lower() in (".csv", ".npz", ".h5", ".hdf5", ".zarr") for path in paths):
        return False
    from faintrack.kinds.records.read import holds

    return all(map(holds, paths))


def _takes(paths: tuple[Path, ...]) -> bool:
    """Recordings become records."""
    from faintrack.io.recordings import READERS

    return all(path.suffix.lower() in READERS for path in paths)


def _write(path: Path, data: Records) -> None:
    """One npz for each station; of several they have the names of the stations after that of the file."""
    from faintrack.errors import InputError

    if path.suffix.lower() != ".npz":
        raise InputError(f"{path}: unknown kind of file; expected .npz for records.")
    for record in data.records:
        if isinstance(record, Recording):
            raise InputError(f"{record.source} is a recording; expected a record.")
        own = path
        if len(data.records) > 1:
            own = path.with_name(f"{path.stem}_{Path(record.source).stem}{path.suffix}")
        try:
            np.savez(
                own,
                energy=record.read(0, record.length),
                time=record.times,
                bearing=dict(record.axes)["bearing"].values,
            )
        except OSError as error:
            raise InputError(f"{own} cannot be written ({error.strerror or error}).") from error


def _describe(data: Records) -> dict[str, str]:
    arrays = "one array" if len(data.records) == 1 else f"{len(data.records)} arrays"
    return {"holds": f"records of {arrays}", **{record.source: _facts(record) for record in data.records}}


def _facts(record: Sequence | Recording) -> str:
    start = "start not known" if record.start_time is None else f"from {record.start_time}Z"
    if isinstance(record, Recording):
        return f"recording of {record.channels} channels at {record.sample_rate:g} Hz, {record.duration:g} s, {start}"
    bearings = dict(record.axes)["bearing"]
    apart = f", {np.median(np.diff(record.times)):g} s apart" if record.length > 1 else ""
    return (
        f"{record.length} rows{apart}, {bearings.count} beams from {bearings.first:g} to {bearings.last:g} degrees, "
        f"{start}"
    )


KIND = Kind(
    name="records",
    title="Records of arrays",
    scenario=RecordsScenario,
    data=Records,
    holds=_holds,
    read=room("faintrack.kinds.records.read", "read"),
    write=_write,
    plan=room("faintrack.kinds.records.plan", "plan"),
    simulate=room("faintrack.kinds.records.simulate", "simulate"),
    targets=room("faintrack.kinds.records.simulate", "targets"),
    silence=room("faintrack.kinds.records.simulate", "silence"),
    describe=_describe,
    about=room("faintrack.kinds.records.report", "about"),
    draw=room("faintrack.kinds.records.pictures", "draw"),
    shown="Map, records, detection",
    needs=("--scenario FILE",),
    takes=_takes,
    surrogate=room("faintrack.kinds.records.quiet", "surrogate"),
    stretch=room("faintrack.kinds.records.quiet", "stretch"),
)
