r"""An array that turns: its heading frame by frame, and true bearings of what it hears.

With :math:`\psi` the heading, of a line that of its axis, a target at bearing :math:`\beta` from the array has the true
bearing :math:`\psi + \beta`; from a line, :math:`\psi + s \beta` with s its side, 1 to starboard. Where the side is not
known, what is told is the likelier one's, with the bearing that a target on that side has: of a belief with mean
:math:`m` and covariance C, for a side of two values exactly,

.. math:: \mathrm{E}[\beta | s] = m_\beta + \frac{C_{\beta s}}{C_{ss}} (s - m_s), \qquad P(s = 1) = \frac{1 + m_s}{2} .

All that is told is linear in the state, and so is its covariance. See `faintrack.targets.turning`.
"""

import dataclasses
import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from jaxtyping import Float

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.headings import read_headings
from faintrack.results.schema import NORTH, Component
from faintrack.sensors.array import SensorArray

STEADY = 1 / 20
"""Of a main lobe: a line that turns by less keeps its heading, as it tells no side."""

EVEN = 0.4
"""Off one half, up to which the share of a side decides nothing; true bearings are then those to starboard."""

TRUE_BEARING = Component("true_bearing", "degree", float(np.degrees(1)), attributes={"reference": NORTH})
STARBOARD = Component("starboard", "1")


@dataclass(frozen=True)
class Course:
    """Headings of the frames of a recording; after the last one the array keeps it.

    Attributes
    ----------
    heading : in the middle of each frame, of a line that of its axis, without jumps; radians clockwise from north.
    turn : since the frame before; radians.
    unsure : standard deviation of `turn`, see `faintrack.targets.turning`; radians.
    steady_since : since when, up to the frame before, the heading had been kept; seconds.
    """

    heading: Float[np.ndarray, " frame"]
    turn: Float[np.ndarray, " frame"]
    unsure: Float[np.ndarray, " frame"]
    steady_since: Float[np.ndarray, " frame"]

    def turns(self, start: int, stop: int) -> tuple[Float[np.ndarray, " frame"], ...]:
        """Turn of some frames, its deviation, and start of their steady time."""
        last = len(self.turn) - 1
        frames = np.arange(start, stop)
        within, frames = frames <= last, np.minimum(frames, last)
        turn, unsure = (np.where(within, part[frames], 0).astype(np.float32) for part in (self.turn, self.unsure))
        return turn, unsure, self.steady_since[frames]

    def at(self, frames: np.ndarray) -> np.ndarray:
        """Heading of frames by number; radians."""
        return self.heading[np.minimum(frames, len(self.heading) - 1)]


def read_course(path: str, recording: Recording, array: SensorArray, frame: float, lobe: float) -> Course:
    """Course of an array from a file (`faintrack.io.headings`).

    Parameters
    ----------
    path : of the file.
    recording : its frames are those of the course.
    array : at heading 0; of a line, its axis may point elsewhere.
    frame : length; s.
    lobe : width of its main lobe; radians.

    Raises
    ------
    InputError : the file cannot be read or does not cover the recording, or the array is a line that stands upright.
    """
    times, degrees = read_headings(path, recording.start_time)
    room = max(frame, float(np.diff(times).max(initial=0)))
    count = max(1, int(recording.length / recording.sample_rate / frame))
    end = times[-1] if recording.live else (count - 0.5) * frame
    if len(times) > 1 and (times[0] > frame / 2 + room or times[-1] < end - room):
        raise InputError(
            f"{path}: headings of the times {times[0]:.10g} to {times[-1]:.10g} s; expected all of the recording's, "
            f"{frame / 2:g} to {end:.10g} s."
        )
    number = min(count, max(1, math.ceil(times[-1] / frame) + 1))
    middles = (np.arange(number) + 0.5) * frame
    heading = np.radians(np.interp(middles, times, degrees)) + axis_heading(array)
    return course_of(middles, heading, STEADY * lobe)


def axis_heading(array: SensorArray) -> float:
    """Direction of a line's axis in its own file, clockwise from north, 0 of other arrays; radians."""
    if array.axis is None:
        return 0.0
    east, north, up = array.axis
    if abs(up) > math.hypot(east, north):
        raise InputError("heading: the channels stand upright; expected a line that lies, or an array that is no line.")
    return math.atan2(east, north)


def course_of(middles: np.ndarray, heading: np.ndarray, steady: float) -> Course:
    """Course from the headings in the middles of frames, one that turns by less than `steady` being kept.

    Examples
    --------
    >>> course_of(np.arange(4.0), np.array([0.0, 0.01, 0.5, 0.5]), 0.1).steady_since.tolist()
    [-inf, -inf, -inf, 1.5]
    """
    since, kept, moment = np.empty(len(heading)), heading[0], -math.inf
    for number, value in enumerate(heading):
        # Of a frame it is what had been kept up to the one before.
        since[number] = moment
        if abs(value - kept) > steady:
            # Between two frames, where rounding puts no target that appeared in one of them on the other side.
            kept, moment = value, (middles[number - 1] + middles[number]) / 2
    turn = np.diff(heading, prepend=heading[0])
    return Course(heading, turn, np.abs(np.diff(turn, prepend=0.0)) / math.sqrt(3), since)


def with_true_bearing(estimates: Any, heading: Float[np.ndarray, " frame"]) -> Any:
    """Estimates with the true bearing, and of a line with the probability of starboard in place of the side.

    Parameters
    ----------
    estimates : of consecutive frames, of one slot or several, whose mean has `bearing`, and `side` of a line.
    heading : of each frame; radians.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from faintrack.targets.states import SidedState
    >>> mean = SidedState(jnp.array([1.0]), jnp.zeros(1), jnp.zeros(1), jnp.array([-0.8]))
    >>> say = SimpleNamespace(mean=mean, covariance=np.diag([0.04, 1.0, 1.0, 0.36])[None])
    >>> say = with_true_bearing(say, np.array([3.0]))
    >>> say.mean.true_bearing.tolist(), say.mean.starboard.round(3).tolist(), say.covariance[0, 3, 3].round(3).item()
    ([2.0], [0.1], 0.04)
    """
    names = [field.name for field in dataclasses.fields(estimates.mean)]
    values = {name: np.asarray(getattr(estimates.mean, name), float) for name in names}
    covariance = np.asarray(estimates.covariance, float)
    heading = heading.reshape(-1, *(1,) * (values["bearing"].ndim - 1))
    kept = [name for name in names if name != "side"]
    place = names.index("bearing")
    rows = [
        np.broadcast_to(np.eye(len(names))[names.index(name)], (*covariance.shape[:-2], len(names))) for name in kept
    ]
    along = np.broadcast_to(np.eye(len(names))[place], rows[0].shape).copy()
    told = {name: values[name] for name in kept}
    if "side" not in names:
        told["true_bearing"] = heading + values["bearing"]
        rows.append(along)
    else:
        number, share = names.index("side"), (1 + values["side"]) / 2
        side = np.where(share >= 0.5 - EVEN, 1.0, -1.0)
        spread = covariance[..., number, number]
        slope = np.where(spread > 1e-6, covariance[..., place, number] / np.where(spread > 1e-6, spread, 1), 0)
        told["true_bearing"] = heading + side * (values["bearing"] + slope * (side - values["side"]))
        along[..., number] = -slope
        told["starboard"] = share
        rows += [side[..., None] * along, np.broadcast_to(np.eye(len(names))[number] / 2, along.shape)]
    matrix = np.stack(rows, axis=-2)
    state = dataclasses.make_dataclass("Directed", list(told))(**told)
    return SimpleNamespace(
        **vars(estimates) | {"mean": state, "covariance": matrix @ covariance @ np.swapaxes(matrix, -1, -2)}
    )
