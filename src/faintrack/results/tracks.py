"""Tracks: what was declared, followed and dropped, as a person reads it."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class BearingTrack:
    """One source from its declaration to its end.

    Attributes
    ----------
    label : running number from 1.
    start_s, end_s : of the first and the last frame of the track (their middle); seconds from the start of the
        recording.
    bearing_deg : circular mean of the bearing over the track, each frame weighted by its certainty; degrees.
    bearing_std_deg : root mean square over the track of the standard deviation at each frame; degrees.
    snr_db : mean over the track; dB.
    existence_max : largest probability that the track's target exists.
    """

    label: int
    start_s: float
    end_s: float
    bearing_deg: float
    bearing_std_deg: float
    snr_db: float
    existence_max: float

    def as_dict(self) -> dict[str, Any]:
        """Fields by name."""
        return asdict(self)


def bearing_tracks(
    time: np.ndarray,
    label: np.ndarray,
    bearing: np.ndarray,
    bearing_std: np.ndarray,
    snr_db: np.ndarray,
    existence: np.ndarray,
) -> list[BearingTrack]:
    """Tracks from what a single-target tracker says frame by frame.

    Parameters
    ----------
    time : seconds; all arguments have the shape (frame,).
    label : of the track in hand, 0 where there is none.
    bearing, bearing_std : radians.
    snr_db : dB.
    existence : of the track's target.

    Examples
    --------
    >>> label, steady = np.array([0, 1, 1, 0]), np.full(4, 0.1)
    >>> track, = bearing_tracks(np.arange(4.0), label, steady, steady, -20 + steady, 0.9 + steady)
    >>> track.start_s, track.end_s, round(track.bearing_deg, 3)
    (1.0, 2.0, 5.73)
    """
    tracks = []
    for number in np.unique(label[label > 0]):
        mine = label == number
        certainty = 1 / np.maximum(bearing_std[mine], 1e-6) ** 2
        direction = np.sum(certainty * np.exp(1j * bearing[mine]))
        tracks.append(
            BearingTrack(
                label=int(number),
                start_s=float(time[mine][0]),
                end_s=float(time[mine][-1]),
                bearing_deg=float(np.degrees(np.angle(direction))),
                bearing_std_deg=float(np.degrees(np.sqrt(np.mean(bearing_std[mine] ** 2)))),
                snr_db=float(np.mean(snr_db[mine])),
                existence_max=float(existence[mine].max()),
            )
        )
    return tracks


@dataclass(frozen=True)
class PositionTrack:
    """One target in frames, returns or records from its declaration to its end.

    Attributes
    ----------
    label : running number from 1.
    start_s, end_s : of the first and the last frame or ping of the track; seconds from the first of all.
    start, end : mean position at these, by component; unit of the axes. In the records of several arrays the latitude
        and the longitude too, where they are known; in those of an array by itself the bearing, degrees.
    speed : distance between the two over the time between them; unit of the axes a second, 0 for a single frame.
    existence_max : largest probability that the track's target exists.
    """

    label: int
    start_s: float
    end_s: float
    start: dict[str, float]
    end: dict[str, float]
    speed: float
    existence_max: float

    @staticmethod
    def fields(components: Iterable[str]) -> list[str]:
        """Names in `as_dict` for these components of the position."""
        places = [f"{name}_{side}" for side in ("start", "end") for name in components]
        return ["label", "start_s", "end_s", *places, "speed", "existence_max"]

    def as_dict(self) -> dict[str, Any]:
        """Fields by name, a position spread over `x_start`, `y_start` and so on."""
        places = [*self.start.values(), *self.end.values()]
        values = [self.label, self.start_s, self.end_s, *places, self.speed, self.existence_max]
        return dict(zip(self.fields(self.start), values, strict=True))


def position_tracks(
    time: np.ndarray, label: np.ndarray, position: dict[str, np.ndarray], existence: np.ndarray
) -> list[PositionTrack]:
    """Tracks from what a tracker says frame by frame.

    Parameters
    ----------
    time : seconds, ascending; all arguments have the shape (frame,).
    label : of the track in hand, 0 where there is none.
    position : components by name. Latitude and longitude are not part of the way; that of a bearing is the shorter one.
    existence : of the track's target.

    Examples
    --------
    >>> label, x = np.array([0, 1, 1, 0]), np.arange(4.0)
    >>> track, = position_tracks(2 * x, label, {"x": 3 * x, "y": 4 * x}, np.full(4, 0.9))
    >>> track.as_dict()["y_end"], track.speed
    (8.0, 2.5)
    """
    tracks = []
    for number in np.unique(label[label > 0]):
        frames = np.flatnonzero(label == number)
        first, last = frames[0], frames[-1]
        start, end = ({name: float(values[frame]) for name, values in position.items()} for frame in (first, last))
        ways = [end[name] - start[name] for name in start if name not in ("latitude", "longitude")]
        way = abs(math.remainder(ways[0], 360)) if "bearing" in start else math.hypot(*ways)
        lasted = float(time[last] - time[first])
        tracks.append(
            PositionTrack(
                label=int(number),
                start_s=float(time[first]),
                end_s=float(time[last]),
                start=start,
                end=end,
                speed=way / lasted if lasted > 0 else 0.0,
                existence_max=float(existence[frames].max()),
            )
        )
    return tracks
