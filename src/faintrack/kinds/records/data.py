"""Records of several arrays in memory."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from faintrack.data.recording import Recording
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError
from faintrack.sensors.array import SensorArray

Path = Mapping[str, np.ndarray]
"""Where an array moves, by the names of columns: `time_s`, `x_m` and `y_m` or `latitude_deg` and `longitude_deg`, and
perhaps `heading_deg`."""


@dataclass(frozen=True)
class Records:
    """What several arrays heard, or one by itself.

    Attributes
    ----------
    records : one for each station of the scenario, in their order: sequences with the one axis `bearing`, in degrees,
        or recordings, which are beamformed.
    paths : of stations that move, by name; the others' are in their files.
    arrays : channels of stations, by name; the others' are in the scenario.
    """

    records: tuple[Sequence | Recording, ...]
    paths: Mapping[str, Path] = field(default_factory=dict)
    arrays: Mapping[str, SensorArray] = field(default_factory=dict)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was assumed, left out, or does not fit; one sentence each."""
        return tuple(f"{record.source}: {remark}" for record in self.records for remark in record.remarks)


def from_records(
    records: Any,
    paths: Mapping[str, Path] | None = None,
    arrays: Mapping[str, SensorArray] | None = None,
) -> Records:
    """Records of several arrays, or of one by itself, from data in memory.

    Parameters
    ----------
    records : one for each station, in their order: `from_frames(energy, axes=(("bearing", Axis(0.0, 1.0, 181)),))`
        with `energy` of the shape (scan, beam), or recordings.
    paths : of stations that move, by name: columns `time_s`, `x_m` and `y_m` or `latitude_deg` and `longitude_deg`,
        and perhaps `heading_deg`; `time_s` is on the clock of the record.
    arrays : channels of stations, by name.

    Raises
    ------
    InputError : something is no record, or there is none.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.data.sequence import from_frames
    >>> south = from_frames(np.zeros((9, 181)), axes=(("bearing", Axis(0.0, 1.0, 181)),))
    >>> len(from_records([south, south]).records)
    2
    """
    given = (records,) if isinstance(records, Sequence | Recording) else tuple(records)
    if not given:
        raise InputError("there are no records; expected one for each station.")
    for number, record in enumerate(given):
        if not isinstance(record, Sequence | Recording):
            raise InputError(
                f"record {number} is a {type(record).__name__}; expected a Sequence, which from_frames makes of an "
                "array, or a Recording."
            )
        if isinstance(record, Sequence) and record.names != ("bearing",):
            raise InputError(f"record {number} has the axes {', '.join(record.names)}; expected bearing alone.")
    return Records(given, paths or {}, arrays or {})
