"""What goes wrong on the way is told, and tracks keep their labels."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

from faintrack.live.packets import Packet, in_order
from faintrack.live.stream import Stream, numbered
from faintrack.live.watch import Watch
from tests.live.streams import CHANNELS, RATE, samples, scenario

SIZE = 250
"""Samples of a packet: half of a frame."""

BEGUN = 10**18
"""Of the sender's clock; nanoseconds since 1970."""


def packets(first: int = 0, stop: int | None = None, at: int = 0, clock: float = 0.0) -> list[Packet]:
    """Packets of the scene's samples from one on, numbered from `at`, on a clock that is off by so many seconds."""
    values = samples()
    stop = len(values) if stop is None else stop
    return [
        Packet(
            (start - first + at) // SIZE,
            start - first + at,
            BEGUN + round(start / RATE * 1e9) + round(clock * 1e9),
            RATE,
            values[start : start + SIZE],
        )
        for start in range(first, stop, SIZE)
    ]


def watched(arrived: list[Packet]) -> tuple[np.ndarray, list[dict[str, Any]], dict[str, int]]:
    """Labels of every scan, events, and counts of a watch."""
    counts: Counter[str] = Counter()
    events: list[dict[str, Any]] = []
    stream = Stream(in_order(arrived, counts), RATE, numbered(CHANNELS), "test", None, np.inf, counts)
    watch = Watch(stream, scenario(), tell=lambda event: events.append(dict(event)))
    labels = [moment.data.label.values for moment in watch.moments()]
    return np.concatenate(labels), events, dict(counts)


@pytest.fixture(scope="module")
def clean() -> np.ndarray:
    labels, events, counts = watched(packets())
    assert set(labels.ravel()) == {0, 1}
    assert not events
    assert not counts
    return labels


def test_packets_swapped_and_doubled_change_nothing(clean: np.ndarray) -> None:
    sent = packets()
    arrived = [packet for number, packet in enumerate(sent) for _ in range(1 + (number % 10 == 3))]
    for number in range(2, len(arrived) - 2, 5):
        arrived[number], arrived[number + 1] = arrived[number + 1], arrived[number]
    labels, events, counts = watched(arrived)
    np.testing.assert_array_equal(labels, clean)
    assert counts == {"doubled": len(arrived) - len(sent)}
    assert {event["event"] for event in events} == {"packets"}


def test_with_a_tenth_of_packets_lost_a_track_keeps_its_label(clean: np.ndarray) -> None:
    """Every tenth, so that no two frames on end say nothing."""
    sent = packets()
    arrived = [packet for number, packet in enumerate(sent) if number % 10 != 7]
    labels, events, counts = watched(arrived)
    assert set(labels.ravel()) == {0, 1}
    assert labels[-1].max() == 1
    assert counts == {"lost": len(sent) - len(arrived)}
    gaps = [event for event in events if event["event"] == "gap"]
    assert [gap["seconds"] for gap in gaps] == [SIZE / RATE] * (len(sent) - len(arrived))
    assert [gap["time"] for gap in gaps] == [SIZE / RATE * number for number in range(7, len(sent), 10)]


@pytest.mark.parametrize("clock", [0.0, -86_400.0], ids=["as it was", "set back a day"])
def test_a_sender_that_begins_anew_changes_nothing(clean: np.ndarray, clock: float) -> None:
    """After 12 s it counts its samples from 0 again."""
    labels, events, counts = watched([*packets(stop=12_000), *packets(first=12_000, clock=clock)])
    np.testing.assert_array_equal(labels, clean)
    assert counts == {"begun_anew": 1}
    assert [event["event"] for event in events] == ["packets"]


def test_a_source_that_was_gone_for_an_hour_goes_on_an_hour_later(clean: np.ndarray) -> None:
    labels, events, counts = watched([*packets(stop=12_000), *packets(first=12_000, clock=3600.0)])
    (gap,) = (event for event in events if event["event"] == "gap")
    assert gap["time"] == 12.0
    assert gap["seconds"] == pytest.approx(3600.0, abs=1e-6)
    assert counts == {"begun_anew": 1}
    # What is taken in before the gap does not know of it.
    np.testing.assert_array_equal(labels[:23], clean[:23])
    assert len(labels) < len(clean) + 60
