"""What came out of a recording, frames, pings or records: every scan as named variables with units, and the tracks."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
import xarray as xr

from faintrack.beliefs.grids import Grid
from faintrack.data.recording import Recording
from faintrack.data.sequence import Sequence
from faintrack.results.tracks import BearingTrack, PositionTrack, bearing_tracks, position_tracks
from faintrack.scenario.build_frames import frame_interval, units_of
from faintrack.scenario.model import Scenario
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import bearings
from faintrack.signal.frames import FrameBlock
from faintrack.targets.states import PlanarState
from faintrack.trackers.single import Estimate

HALF = float(np.finfo(np.float16).max)
"""Largest number in the half precision of pictures."""


@dataclass(frozen=True)
class Result:
    """What came out of a recording, a sequence of frames, returns, bearings, or the records of several arrays.

    Attributes
    ----------
    data : one entry a frame, ping or scan; existence, bearing or position, record and the rest, with units in their
        attributes.
    tracks : what was declared.
    scenario : what was run.
    array : whose recording it was; None for all else.
    seconds : that the run took.
    """

    data: xr.Dataset
    tracks: list[BearingTrack] | list[PositionTrack]
    scenario: Scenario
    array: SensorArray | None
    seconds: float

    @property
    def kind(self) -> Literal["recording", "frames", "returns", "records", "bearings"]:
        """What was tracked in."""
        if self.array is not None:
            return "recording"
        if self.scenario.stations is not None:
            return "records"
        if self.scenario.bearings is not None:
            return "bearings"
        return "frames" if self.scenario.sonar is None else "returns"

    @property
    def scan(self) -> Literal["frame", "ping", "scan"]:
        """What an entry of the data is."""
        return SCAN[self.kind]

    @property
    def existence(self) -> xr.DataArray:
        """Probability that a target exists, scan by scan; of records, that of every slot does."""
        return self.data.existence

    @property
    def bearing(self) -> xr.DataArray:
        """Bearing of the track in hand, in each slot where there are slots; degrees, not a number without a track."""
        return self.data.bearing.where(self.data.label > 0)

    @property
    def record(self) -> xr.DataArray:
        """Bearing-time record: beam power over the sum of the channels' powers, mean over the band; dB.

        Noise without direction has 0 dB, a lone plane wave as many as the channels' number.
        """
        return self.data.record

    def summary(self) -> dict[str, Any]:
        """Tracks and speed as plain values, for programs.

        `frames`, `pings` or `scans` is their number, `seconds` what the run took, `realtime_factor` the length of the
        recording over it, `masked_frames` the number of frames of a recording in which a channel was left out because a
        sample was not finite, `full_scans` the number of scans in which a target was found and no slot was free.
        """
        scans = self.data.sizes["time"]
        recorded = self.kind == "recording"
        interval = self.scenario.analysis.frame if recorded else self.data.attrs[f"{self.scan}_interval"]
        more = {}
        if recorded:
            more["masked_frames"] = int((self.data.masked_channels > 0).sum())
        if self.kind == "records":
            more["full_scans"] = int(self.data.full.sum())
        return {
            "tracks": [track.as_dict() for track in self.tracks],
            f"{self.scan}s": scans,
            "seconds": self.seconds,
            "realtime_factor": scans * interval / self.seconds,
            **more,
        }


SCAN: dict[str, Literal["frame", "ping", "scan"]] = {
    "recording": "frame",
    "frames": "frame",
    "returns": "ping",
    "records": "scan",
    "bearings": "scan",
}


def positions(data: xr.Dataset) -> list[str]:
    """Components of the position in the data of frames, returns or records; none in those of a recording."""
    if "slot" in data.sizes and "x" not in data:
        return ["bearing"]
    if "slot" in data.sizes:
        return ["x", "y", *(name for name in ("latitude", "longitude") if name in data)]
    return [name for name in ("x", "y", "range") if name + "_std" in data]


def position_units(data: xr.Dataset) -> dict[str, str]:
    """Unit of each component of the position."""
    # The position of several targets has a covariance, that of one a mean and a standard deviation.
    several = "slot" in data.sizes
    return {name: data[name if several else f"{name}_std"].attrs["units"] for name in positions(data)}


def track_fields(data: xr.Dataset) -> list[str]:
    """Names of what is told of a track in the data of a result."""
    names = positions(data)
    return PositionTrack.fields(names) if names else [field.name for field in fields(BearingTrack)]


def tracks_of(data: xr.Dataset) -> list[BearingTrack] | list[PositionTrack]:
    """Tracks in the data of a result."""
    names = positions(data)
    if "slot" in data.sizes:
        time = np.repeat(data.time.values, data.sizes["slot"])
        label, existence, *places = (data[name].values.ravel() for name in ("label", "existence", *names))
        return position_tracks(time, label, dict(zip(names, places, strict=True)), existence)
    if names:
        time, label, existence = (data[name].values for name in ("time", "label", "track_existence"))
        return position_tracks(time, label, {name: data[_mean(name)].values for name in names}, existence)
    columns = (data[name].values for name in ("time", "label", "bearing", "bearing_std", "snr", "track_existence"))
    time, label, bearing, std, snr_db, existence = columns
    return bearing_tracks(time, label, np.radians(bearing), np.radians(std), snr_db, existence)


def frames_dataset(
    block: FrameBlock, estimates: Estimate, record: np.ndarray, array: SensorArray, recording: Recording
) -> xr.Dataset:
    """Blocks of estimates as named variables with units."""
    reference = "clockwise from north" if array.circular else "from the array axis"
    degrees = {"units": "degree", "reference": reference}
    beams = record.shape[1]
    bearing = np.degrees(bearings(beams, array.circular))

    deg = np.degrees
    masked = (~block.usable & array.alive).sum(axis=1).astype(np.int32)
    return xr.Dataset(
        {
            **_believed(estimates),
            "bearing": _each(deg(estimates.mean.bearing), long_name="bearing", **degrees),
            "bearing_std": _each(deg(estimates.std.bearing), "degree", "standard deviation of the bearing"),
            "bearing_rate": _each(deg(estimates.mean.bearing_rate), "degree/s", "bearing rate"),
            "snr": _each(estimates.mean.snr_db, "dB", "signal to noise ratio at one channel"),
            "snr_std": _each(estimates.std.snr_db, "dB", "standard deviation of the signal to noise ratio"),
            "masked_channels": _each(masked, "1", "channels left out, samples not finite"),
            "record": (
                ("time", "beam"),
                record,
                {"units": "dB", "long_name": "beam power over the sum of the channels' powers"},
            ),
        },
        coords={
            "time": ("time", block.time, {"units": "s", "long_name": "time from the start of the recording"}),
            "beam": ("beam", bearing, {"long_name": "bearing", **degrees}),
        },
        attrs={
            "source": recording.source,
            "start_time": "" if recording.start_time is None else f"{recording.start_time}Z",
        },
    )


def sequence_dataset(
    times: np.ndarray, estimates: Estimate, rows: dict[str, np.ndarray], sequence: Sequence
) -> xr.Dataset:
    """Estimates of a stretch of a sequence as named variables with units.

    Parameters
    ----------
    times : of the frames, from the first of the sequence; seconds.
    estimates : of the tracker, stacked.
    rows : of profiles the `record` and the `surface`, shape (frame, cell).
    sequence : that they belong to.
    """
    axes = dict(sequence.axes)
    variables = _estimated(estimates, lambda name: units_of(name, axes))
    names = {"record": "value over what is expected without a target", "surface": SURFACE}
    for name, values in rows.items():
        half = np.clip(values, -HALF, HALF).astype(np.float16)
        variables[name] = (("time", *axes), half, {"units": "1", "long_name": names[name]})
    coordinates = _coordinates(sequence) if rows else {}
    coordinates["time"] = ("time", times, {"units": "s", "long_name": "time from the first frame"})
    return xr.Dataset(variables, coordinates, _attributes(sequence))


def pings_dataset(
    times: np.ndarray, estimates: Estimate, modes: PlanarState, more: dict[str, np.ndarray], attributes: dict[str, Any]
) -> xr.Dataset:
    """Estimates of consecutive pings as named variables with units.

    Parameters
    ----------
    times : of the pings, from the first; seconds.
    estimates : of the tracker, stacked.
    modes : middle of the cell with the highest probability after each ping.
    more : by name, `returns`, their number, and `source_x`, `source_y`, `receiver_x`, `receiver_y`; m.
    attributes : of the whole.
    """
    variables = _estimated(estimates, _of_plane)
    for field in fields(modes):
        unit, values = _of_plane(field.name), np.asarray(getattr(modes, field.name))
        variables[f"{field.name}_mode"] = _each(values, unit, f"most probable {field.name}")
    for name, values in more.items():
        unit = "1" if name == "returns" else "m"
        told = "returns of the ping" if name == "returns" else f"{name[-1]} of the {name[:-2]}"
        variables[name] = _each(values, unit, told)
    coordinates = {"time": ("time", times, {"units": "s", "long_name": "time from the first ping"})}
    return xr.Dataset(variables, coordinates, attributes)


def bearings_dataset(
    times: np.ndarray,
    estimates: Estimate,
    more: dict[str, np.ndarray],
    place: np.ndarray,
    observers: np.ndarray,
    attributes: dict[str, Any],
) -> xr.Dataset:
    """Estimates of consecutive scans of bearings as named variables with units.

    Parameters
    ----------
    times : of the scans, from the first; seconds.
    estimates : of the tracker, stacked.
    more : by name `heard`, degrees clockwise from north, and `association`, shape (scan, observer, entry), not a number
        where an entry holds no bearing; `xy_covariance`, shape (scan,).
    place : of the observers, shape (scan, observer, 2); m.
    observers : their numbers.
    attributes : of the whole.
    """
    variables = _estimated(estimates, _of_plane)
    variables["xy_covariance"] = _each(more["xy_covariance"], "m^2", "covariance of x and y")
    entries = ("time", "observer", "entry")
    degrees = {"units": "degree", "reference": "clockwise from north"}
    variables["heard"] = (entries, more["heard"], {"long_name": "bearings of the scan", **degrees})
    told = {"units": "1", "long_name": "probability that the bearing is the target's"}
    variables["association"] = (entries, more["association"], told)
    for number, name in enumerate("xy"):
        told = {"units": "m", "long_name": f"{name} of the observer"}
        variables[f"observer_{name}"] = (("time", "observer"), place[..., number], told)
    coordinates = {
        "time": ("time", times, {"units": "s", "long_name": "time from the first scan"}),
        "observer": ("observer", observers, {"units": "1", "long_name": "number of the observer"}),
    }
    return xr.Dataset(variables, coordinates, attributes)


def marginals_dataset(
    times: np.ndarray, position: np.ndarray, velocity: np.ndarray, grid: Grid, attributes: dict[str, Any]
) -> xr.Dataset:
    """What is believed of position and velocity after some pings, with a snapshot axis in place of time.

    Parameters
    ----------
    times : of the pings, from the first; seconds.
    position, velocity : log of the probability of every cell, if a target exists; shapes (snapshot, x, y) and
        (snapshot, vx, vy).
    grid, attributes : of the whole.
    """
    coordinates: dict[str, Any] = {
        name: (name, axis.values, {"units": _of_plane(name), "long_name": name}) for name, axis in grid.axes
    }
    coordinates["snapshot"] = ("snapshot", times, {"units": "s", "long_name": "time from the first ping"})
    told = "log of the probability of a cell of {}, if a target exists"
    variables = {
        "position": (("snapshot", "x", "y"), position, {"units": "1", "long_name": told.format("position")}),
        "velocity": (("snapshot", "vx", "vy"), velocity, {"units": "1", "long_name": told.format("velocity")}),
    }
    return xr.Dataset(variables, coordinates, attributes)


def pictures_dataset(times: np.ndarray, frames: np.ndarray, surfaces: np.ndarray, sequence: Sequence) -> xr.Dataset:
    """Some images of a sequence and the surfaces after them, both with a snapshot axis in place of time."""
    dims = ("snapshot", *dict(sequence.axes))
    coordinates = _coordinates(sequence)
    coordinates["snapshot"] = ("snapshot", times, {"units": "s", "long_name": "time from the first frame"})
    variables = {
        "frame": (dims, frames, {"units": "1", "long_name": "value in the file"}),
        "surface": (dims, surfaces, {"units": "1", "long_name": SURFACE}),
    }
    return xr.Dataset(variables, coordinates, _attributes(sequence))


def joined(blocks: Iterable[xr.Dataset]) -> xr.Dataset:
    """Consecutive blocks as one; what has no time axis is added as it is."""
    held = list(blocks)
    timed = xr.concat([block for block in held if "time" in block.sizes], "time", combine_attrs="override")
    return xr.merge([timed, *(block for block in held if "time" not in block.sizes)], combine_attrs="override")


SURFACE = "log of the target likelihood ratio"


def _each(values: Any, units: str, long_name: str, **more: str) -> tuple[str, np.ndarray, dict[str, str]]:
    """A variable with one value a frame or ping."""
    return "time", np.asarray(values), {"units": units, "long_name": long_name, **more}


def _believed(estimates: Estimate) -> dict[str, Any]:
    """Variables of what a tracker says of any target, whatever its state is."""
    return {
        "existence": _each(estimates.existence, "1", "probability that a target exists"),
        "label": _each(estimates.label, "1", "track in hand, 0 where there is none"),
        "track_existence": _each(estimates.track_existence, "1", "probability that the track's target exists"),
        "log_evidence": _each(estimates.log_evidence, "1", "log of the mean likelihood ratio"),
    }


def _estimated(estimates: Estimate, unit_of: Callable[[str], str]) -> dict[str, Any]:
    """Variables of what a tracker says, with the mean and the standard deviation of each component of the state."""
    variables = _believed(estimates)
    for field in fields(estimates.mean):
        name, unit, long_name = field.name, unit_of(field.name), field.name.replace("_", " ")
        variables[_mean(name)] = _each(getattr(estimates.mean, name), unit, f"mean {long_name}")
        std = getattr(estimates.std, name)
        variables[f"{name}_std"] = _each(std, unit, f"standard deviation of {long_name}")
    return variables


def _of_plane(name: str) -> str:
    """Unit of a component in the plane."""
    return "m" if name in ("x", "y") else "m/s"


def _mean(name: str) -> str:
    """Name of the variable that holds the mean of a component; that of an axis is taken."""
    return f"{name}_mean"


def _coordinates(sequence: Sequence) -> dict[str, Any]:
    axes = dict(sequence.axes)
    return {
        name: (name, axis.values, {"units": units_of(name, axes), "long_name": name.replace("_", " ")})
        for name, axis in sequence.axes
    }


def _attributes(sequence: Sequence) -> dict[str, Any]:
    return {
        "source": sequence.source,
        "first_frame_time": float(sequence.times[0]),
        "frame_interval": frame_interval(sequence),
    }
