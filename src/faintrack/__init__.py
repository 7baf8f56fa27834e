"""Detect and follow targets too quiet to threshold, from raw sensor data.

The names that a session needs are here; everything else is in the modules that it belongs to. They are loaded when they
are first used, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from faintrack.data.bearings import Bearings
    from faintrack.data.bearings import from_columns as from_bearings
    from faintrack.data.recording import Recording, from_samples
    from faintrack.data.returns import Returns
    from faintrack.data.returns import from_columns as from_returns
    from faintrack.data.sequence import Sequence, from_frames
    from faintrack.errors import InputError
    from faintrack.io.arrays import read_array
    from faintrack.kinds.calibration import calibrate
    from faintrack.kinds.door import Info, Moment, follow, info, read, read_result, simulate, track
    from faintrack.kinds.false_tracks import calibrate_on
    from faintrack.kinds.records.data import Records, from_records
    from faintrack.kinds.scenario import Scenario
    from faintrack.kinds.sweeps.data import Sweeps, from_sweeps
    from faintrack.results.result import Result
    from faintrack.results.track import Track
    from faintrack.sensors.array import SensorArray, line_array, sensor_array

_HOMES = {
    "track": "kinds.door",
    "follow": "kinds.door",
    "simulate": "kinds.door",
    "calibrate": "kinds.calibration",
    "calibrate_on": "kinds.false_tracks",
    "read": "kinds.door",
    "info": "kinds.door",
    "read_result": "kinds.door",
    "Scenario": "kinds.scenario",
    "Result": "results.result",
    "Track": "results.track",
    "Moment": "kinds.door",
    "Info": "kinds.door",
    "InputError": "errors",
    "Recording": "data.recording",
    "from_samples": "data.recording",
    "Sequence": "data.sequence",
    "from_frames": "data.sequence",
    "Returns": "data.returns",
    "from_returns": "data.returns:from_columns",
    "Bearings": "data.bearings",
    "from_bearings": "data.bearings:from_columns",
    "Records": "kinds.records.data",
    "from_records": "kinds.records.data",
    "Sweeps": "kinds.sweeps.data",
    "from_sweeps": "kinds.sweeps.data",
    "SensorArray": "sensors.array",
    "sensor_array": "sensors.array",
    "line_array": "sensors.array",
    "read_array": "io.arrays",
}
"""Module of each public name, and its name there where it is another."""

__all__ = [
    "Bearings",
    "Info",
    "InputError",
    "Moment",
    "Recording",
    "Records",
    "Result",
    "Returns",
    "Scenario",
    "SensorArray",
    "Sequence",
    "Sweeps",
    "Track",
    "calibrate",
    "calibrate_on",
    "follow",
    "from_bearings",
    "from_frames",
    "from_records",
    "from_returns",
    "from_samples",
    "from_sweeps",
    "info",
    "line_array",
    "read",
    "read_array",
    "read_result",
    "sensor_array",
    "simulate",
    "track",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        module, _, own = _HOMES[name].partition(":")
        return getattr(import_module(f"faintrack.{module}"), own or name)
    raise AttributeError(f"module 'faintrack' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
