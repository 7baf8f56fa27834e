"""A small scene and its streams, for the tests of the live room."""

import threading
from collections.abc import Callable, Iterator
from functools import cache

import numpy as np

from faintrack.data.recording import Recording, from_samples
from faintrack.kinds.scenario import Scenario
from faintrack.live.stream import Piece, Stream, numbered
from faintrack.live.watch import Watch
from faintrack.sensors.array import line_array
from faintrack.simulation.samples import Source, draw_samples

RATE, CHANNELS, FRAME = 1000.0, 4, 0.5

SECTIONS = {
    "kind": "recording",
    "array": {"sound_speed": 1500.0, "line": {"count": CHANNELS, "spacing": 0.75}},
    "analysis": {"frame": FRAME, "beams": 36},
    "filter": {"particles": 60, "births": 30},
    "tracker": {"targets": 2},
}


@cache
def samples(seconds: float = 16.0) -> np.ndarray:
    """A loud source from 4 s on, in single precision."""
    array = line_array(CHANNELS, 0.75)
    drawn = list(draw_samples(array, [Source(3.0, 1.0, start=4.0)], seconds, RATE))
    return np.concatenate(drawn).astype(np.float32)


def scenario(**sections: object) -> Scenario:
    return Scenario(**(SECTIONS | sections))


def recording() -> Recording:
    return from_samples(samples(), RATE)


def stream(pieces: Iterator[Piece], pace: float = np.inf) -> Stream:
    return Stream(pieces, RATE, numbered(CHANNELS), "test", np.datetime64("2026-01-01T00:00:00", "ns"), pace)


def pieces(values: np.ndarray, size: int = 137) -> Iterator[Piece]:
    for start in range(0, len(values), size):
        yield Piece(start / RATE, values[start : start + size], 0)


def existences(watch: Watch) -> np.ndarray:
    """Of every scan and slot."""
    return np.concatenate([moment.data.existence.values for moment in watch.moments()])


def in_thread(call: Callable[[], object]) -> threading.Thread:
    thread = threading.Thread(target=call, daemon=True)
    thread.start()
    return thread
