"""Records without a target: surrogates of them, and stretches."""

from dataclasses import replace

import numpy as np

from faintrack.data.recording import Recording
from faintrack.data.sequence import Sequence
from faintrack.kinds.records.data import Records
from faintrack.kinds.records.sections import RecordsScenario
from faintrack.kinds.records.together import arrays_of, require_one_each
from faintrack.kinds.stretches import of_recording, of_sequence
from faintrack.kinds.surrogates import reordered, shifted_apart


def surrogate(data: Records, scenario: RecordsScenario, seed: int) -> Records:
    """Records whose scans are in another order, each record's in one of its own; channels of recordings shifted apart.

    Raises
    ------
    InputError : a recording is too short, or its channels are not known.
    """
    require_one_each(data, scenario)
    arrays, _ = arrays_of(data, scenario)
    records: list[Sequence | Recording] = []
    for number, (table, record) in enumerate(zip(scenario.stations, data.records, strict=True)):
        own = seed * len(data.records) + number
        if isinstance(record, Recording):
            positions, speed = arrays[table.name].positions, arrays[table.name].sound_speed
            across = np.linalg.norm(positions[:, None] - positions[None], axis=-1).max()
            records.append(shifted_apart(record, float(across / speed) + scenario.analysis.frame, own))
        else:
            records.append(reordered(record, own))
    return replace(data, records=tuple(records))


def stretch(data: Records, start: float, stop: float) -> Records:
    """Records between two times, seconds from the first scan of each."""
    parts = tuple(
        of_recording(record, start, stop) if isinstance(record, Recording) else of_sequence(record, start, stop)
        for record in data.records
    )
    return replace(data, records=parts)
