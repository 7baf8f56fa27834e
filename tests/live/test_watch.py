"""A stream gives the numbers of its file, whatever the pieces; what is missing is missing and shifts nothing."""

import io
import os
import socket
import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import soundfile

import faintrack as ft
from faintrack.live.buffer import Buffer
from faintrack.live.bytestream import Bytes, Raw, bytestream, growing_file, named_pipe
from faintrack.live.packets import HEADER, Packet, datagrams, in_order, unpack
from faintrack.live.replay import replay
from faintrack.live.stream import Piece
from faintrack.live.watch import Watch
from tests.live.streams import (
    CHANNELS,
    FRAME,
    RATE,
    existences,
    in_thread,
    pieces,
    recording,
    samples,
    scenario,
    stream,
)

MOST = 10.0
"""Seconds that a test waits for what happens at once."""


@pytest.fixture(scope="module")
def followed() -> np.ndarray:
    return np.concatenate([moment.data.existence.values for moment in ft.follow(recording(), scenario())])


def test_a_stream_gives_the_bits_of_its_recording(followed: np.ndarray) -> None:
    watch = Watch(stream(pieces(samples())), scenario())
    np.testing.assert_array_equal(existences(watch), followed)
    assert watch.status.scans == len(followed) == 32
    assert (watch.status.gaps, watch.status.left_out) == (0, 0)


def test_a_stream_agrees_with_track() -> None:
    """Blocks sum in another order: the tolerance of following a recording."""
    result = ft.track(recording(), scenario())
    found = existences(Watch(stream(pieces(samples())), scenario()))
    np.testing.assert_allclose(found, result.data.existence, atol=1e-2)
    assert result.tracks


def test_replay_gives_the_same_bits(followed: np.ndarray) -> None:
    watch = Watch(replay(recording(), 40.0, threading.Event()), scenario())
    np.testing.assert_array_equal(existences(watch), followed)


def test_gaps_are_missing_samples() -> None:
    """Half a second that did not come is half a second of no number; what follows keeps its time."""
    holed = samples().copy()
    holed[6200:7900] = np.nan
    parts = [*pieces(samples()[:6200]), Piece(7.9, samples()[7900:], 1700)]
    told: list = []
    watch = Watch(stream(iter(parts)), scenario(), told.append)
    expected = [m.data.existence.values for m in ft.follow(ft.from_samples(holed, RATE), scenario())]
    np.testing.assert_array_equal(existences(watch), np.concatenate(expected))
    assert told == [{"event": "gap", "time": 6.2, "seconds": 1.7}]
    assert watch.remarks()[-1] == "1.7 s in 1 stretches did not come; they are missing."


def test_a_long_gap_is_passed_over() -> None:
    parts = [*pieces(samples()[:12_000]), Piece(0.0, samples()[12_000:], 3600_000)]
    times = [moment.time for moment in Watch(stream(iter(parts)), scenario()).moments()]
    # The frame that the gap ends in, or one before it, is the first that is taken in again.
    assert times[:24] == [FRAME * (number + 0.5) for number in range(24)]
    assert times[24:] == [3612 + FRAME * (number + 0.5) for number in range(8)]


def test_what_a_slow_machine_leaves_out_is_whole_scans() -> None:
    """A stream in step with the clock goes on while nobody takes it in: the buffer is emptied, and never grows."""
    told: list = []
    source = stream(iter(()), pace=1.0)
    watch_buffer = Buffer(source)
    watch_buffer._capacity = 4000
    for part in pieces(samples()[:9990], 333):
        watch_buffer._begun = time.monotonic() - 1000.0
        watch_buffer.put(part.values)
        assert watch_buffer._count <= 4000
    assert watch_buffer.end == 9990
    assert watch_buffer.left_out_before % 333 == 0
    watch = Watch(stream(pieces(samples())), scenario(), told.append)
    watch.buffer._left_out_before = 5 * watch.frame + 1
    numbers = [moment.checkpoint.scans for moment in watch.moments()]
    assert numbers[0] == 7
    assert told[0] == {"event": "too_slow", "time": 0.0, "scans": 6, "scans_in_all": 6}


def test_a_stream_ahead_of_the_clock_waits() -> None:
    buffer = Buffer(stream(pieces(samples())))
    buffer._capacity = 4000
    buffer.start()
    time.sleep(0.3)
    assert buffer._count <= 4000
    assert not buffer.over
    np.testing.assert_array_equal(buffer.read(0, 500), samples()[:500])
    buffer.stop.set()


def test_a_frame_beyond_what_is_held_is_refused() -> None:
    with pytest.raises(ft.InputError, match=r"are needed at once and .* s are held"):
        Buffer(stream(iter(()))).read(0, 10**9)


def wave(values: np.ndarray) -> bytes:
    file = io.BytesIO()
    soundfile.write(file, values, int(RATE), subtype="FLOAT", format="WAV")
    return file.getvalue()


@pytest.mark.parametrize("form", ["wav", "float32", "int16"])
def test_bytes_of_every_form(form: str, tmp_path: Path) -> None:
    values = np.clip(samples()[:3000] / 16, -1, 1)
    if form == "wav":
        content, raw, expected = wave(values), None, values
    elif form == "float32":
        content, raw, expected = values.tobytes(), Raw(CHANNELS, RATE), values
    else:
        whole = np.round(values * 2**15).astype("<i2")
        content, raw, expected = whole.tobytes(), Raw(CHANNELS, RATE, "int16"), whole.astype(np.float32) / 2**15
    read_end, write_end = os.pipe()

    def write() -> None:
        with os.fdopen(write_end, "wb") as file:
            for start in range(0, len(content), 1001):
                file.write(content[start : start + 1001])

    in_thread(write)
    found = bytestream(Bytes(read_end, threading.Event()), "pipe", raw)
    assert (found.sample_rate, len(found.channel_names)) == (RATE, CHANNELS)
    np.testing.assert_array_equal(np.concatenate([piece.values for piece in found.pieces]), expected)
    os.close(read_end)


def test_a_file_that_grows_is_read_to_where_it_is(tmp_path: Path) -> None:
    file, content, stop = tmp_path / "night.wav", wave(samples()[:2000]), threading.Event()
    file.write_bytes(content[:5000])
    found = growing_file(file, stop, None)
    first = next(found.pieces).values
    with file.open("ab") as opened:
        opened.write(content[5000:])
    got = len(first)
    for piece in found.pieces:
        got += len(piece.values)
        if got == 2000:
            break
    stop.set()
    assert list(found.pieces) == []


def test_a_file_that_was_cut_is_told(tmp_path: Path) -> None:
    file = tmp_path / "night.raw"
    file.write_bytes(samples()[:2000].tobytes())
    found = growing_file(file, threading.Event(), Raw(CHANNELS, RATE))
    next(found.pieces)
    file.write_bytes(b"")
    with pytest.raises(ft.InputError, match="the file was cut to less than the"):
        list(found.pieces)


def test_a_pipe_is_awaited(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    in_thread(lambda: (time.sleep(0.3), pipe.write_bytes(wave(samples()[:2000]))))
    found = named_pipe(pipe, threading.Event(), None)
    np.testing.assert_array_equal(np.concatenate([piece.values for piece in found.pieces]), samples()[:2000])


def packets(values: np.ndarray, size: int = 50) -> list[Packet]:
    return [
        Packet(number, number * size, 10**18 + number * size * 10**6, RATE, values[number * size : (number + 1) * size])
        for number in range(len(values) // size)
    ]


def test_packets_lost_late_and_doubled_leave_every_sample_in_its_place() -> None:
    rng, values = np.random.default_rng(5), samples()[:10_000]
    sent = packets(values)
    kept = [packet for packet in sent if packet.sequence == 0 or rng.random() > 0.1]
    # Neighbours are exchanged and some come twice; the last comes at the end.
    arrived = [packet for packet in kept for _ in range(1 + (rng.random() < 0.1))]
    for number in range(2, len(arrived) - 2, 5):
        arrived[number], arrived[number + 1] = arrived[number + 1], arrived[number]
    counts: Counter[str] = Counter()
    found = list(in_order(arrived, counts))
    end = 0
    for piece in found:
        end += piece.gap
        assert round(piece.time * RATE) == end
        np.testing.assert_array_equal(piece.values, values[end : end + len(piece.values)])
        end += len(piece.values)
    lost = kept[-1].sequence + 1 - len(kept)
    assert sum(piece.gap for piece in found) == 50 * lost
    assert counts == {"lost": lost, "doubled": len(arrived) - len(kept)}


def test_a_sender_that_begins_anew_is_put_in_its_place_by_its_clock() -> None:
    values = samples()
    again = [
        Packet(number, 50 * number, 10**18 + (20_000 + 50 * number) * 10**6, RATE, values[:50]) for number in range(3)
    ]
    counts: Counter[str] = Counter()
    found = list(in_order([*packets(values[:12_000]), *again], counts))
    assert [(round(piece.time * RATE), piece.gap) for piece in found[-3:]] == [(20_000, 8000), (20_050, 0), (20_100, 0)]
    assert counts == {"begun_anew": 1}


def test_nothing_in_a_packet_is_believed() -> None:
    rng, good = np.random.default_rng(0), packets(samples()[:100])[1]
    content = bytearray(good.pack())
    for _ in range(2000):
        wrong = bytearray(content[: rng.integers(0, len(content))])
        for place in rng.integers(0, 36, size=3):
            if place < len(wrong):
                wrong[place] = rng.integers(0, 256)
        unpack(bytes(wrong))
    assert unpack(HEADER.pack(b"FTK1", 0, 0, 0, float("nan"), 4, 2)) is None
    far = Packet(9, 2**49, 0, RATE, good.values)
    other = Packet(9, 100, 0, RATE / 2, good.values)
    counts: Counter[str] = Counter()
    assert len(list(in_order([*packets(samples()[:100]), far, other], counts))) == 2
    assert counts == {"malformed": 2}


def test_a_socket_gives_the_bits_of_the_file(followed: np.ndarray) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            time.sleep(0.3)
            sender.sendto(b"noise", ("127.0.0.1", port))
            for packet in packets(samples()):
                sender.sendto(packet.pack(), ("127.0.0.1", port))
                time.sleep(5e-4)
            end = Packet(320, 16_000, 0, RATE, np.empty((0, CHANNELS), np.float32))
            sender.sendto(end.pack(), ("127.0.0.1", port))

    in_thread(send)
    found = datagrams("127.0.0.1", port, threading.Event())
    np.testing.assert_array_equal(existences(Watch(found, scenario())), followed)
    assert found.counts == {"malformed": 1}
