"""Packets over TCP: the samples are those that were sent, also after connections that break."""

import socket
import threading
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import pytest

from faintrack.live.packets import Packet
from faintrack.live.stream import Piece
from faintrack.live.tcp import LENGTH, connected, framed, listening

SIZE, COUNT, RATE = 10, 12, 100.0


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener


def samples() -> np.ndarray:
    return np.arange(SIZE * COUNT * 2, dtype=np.float32).reshape(-1, 2)


def packet(number: int) -> bytes:
    """Bytes of a packet; the last ends the stream."""
    part = samples()[number * SIZE : (number + 1) * SIZE]
    return framed(Packet(number, number * SIZE, 10**18 + number * 10**8, RATE, part).pack())


def laid_out(pieces: Iterator[Piece]) -> np.ndarray:
    """Samples of pieces, NaN where some are missing."""
    parts = []
    for piece in pieces:
        parts += [np.full((piece.gap, 2), np.nan, np.float32), piece.values]
    return np.concatenate(parts)


def served(listener: socket.socket, *connections: bytes) -> None:
    """Send some bytes to whoever connects, and close; then to the next. Who has had enough may close before."""

    def serve() -> None:
        for content in connections:
            connection, _ = listener.accept()
            with connection, suppress(OSError):
                for start in range(0, len(content), 37):
                    connection.sendall(content[start : start + 37])

    threading.Thread(target=serve, daemon=True).start()


def stream(listener: socket.socket) -> tuple[np.ndarray, dict[str, int]]:
    host, port = listener.getsockname()
    found = connected(host, port, threading.Event(), pauses=(0.01, 0.02))
    assert found.sample_rate == RATE
    return laid_out(found.pieces), dict(found.counts)


def test_bytes_in_any_pieces_are_the_samples(listener: socket.socket) -> None:
    served(listener, b"".join(map(packet, range(COUNT + 1))))
    values, counts = stream(listener)
    np.testing.assert_array_equal(values, samples())
    assert not counts


def test_what_was_sent_while_a_connection_was_broken_is_missing_and_counted(listener: socket.socket) -> None:
    """The first ends in the middle of packet 4; the second begins with packet 6."""
    served(listener, b"".join(map(packet, range(5)))[:-11], b"".join(map(packet, range(6, COUNT + 1))))
    values, counts = stream(listener)
    expected = samples()
    expected[4 * SIZE : 6 * SIZE] = np.nan
    np.testing.assert_array_equal(values, expected)
    assert counts == {"lost": 2, "connected_again": 1}


def test_packets_that_are_sent_again_after_a_break_count_once(listener: socket.socket) -> None:
    served(listener, b"".join(map(packet, range(5))), b"".join(map(packet, range(3, COUNT + 1))))
    values, counts = stream(listener)
    np.testing.assert_array_equal(values, samples())
    assert counts == {"doubled": 2, "connected_again": 1}


@pytest.mark.parametrize("wrong", [LENGTH.pack(2**31), framed(b"hello, this is no packet")], ids=["length", "packet"])
def test_after_bytes_that_make_no_sense_it_connects_again(listener: socket.socket, wrong: bytes) -> None:
    served(listener, packet(0) + wrong + packet(1), b"".join(map(packet, range(1, COUNT + 1))))
    values, counts = stream(listener)
    np.testing.assert_array_equal(values, samples())
    assert counts == {"malformed": 1, "connected_again": 1}


def test_a_sender_that_connects_gives_the_same() -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]

    def send() -> None:
        for content in (b"".join(map(packet, range(5))), b"".join(map(packet, range(5, COUNT + 1)))):
            connection = None
            while connection is None:
                try:
                    connection = socket.create_connection(("127.0.0.1", port))
                except OSError:
                    threading.Event().wait(0.02)
            with connection:
                connection.sendall(content)

    threading.Thread(target=send, daemon=True).start()
    found = listening("127.0.0.1", port, threading.Event())
    np.testing.assert_array_equal(laid_out(found.pieces), samples())
    assert dict(found.counts) == {"connected_again": 1}
