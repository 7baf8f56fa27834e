"""Samples in packets over TCP, from a sender that is connected to or that connects.

The packets are those of `faintrack.live.packets`, each after its length in bytes, a whole number of 32 bits,
little-endian. A connection that breaks is made again, after pauses that grow from a second to a minute; what was sent
meanwhile is missing, told and counted, since a sample's place comes from its number. After a length or a packet that is
none the connection is closed, since it is not known where the next packet begins.
"""

import socket
import struct
import threading
from collections import Counter
from collections.abc import Callable, Iterator

from faintrack.errors import InputError
from faintrack.live.packets import PATIENCE, Packet, stream_of, unpack
from faintrack.live.stream import Stream

LENGTH = struct.Struct("<I")

LARGEST = 2**20
"""Bytes of a packet at most."""

PAUSES = 1.0, 60.0
"""Seconds before a connection is tried again: at first, and at most."""


def framed(content: bytes) -> bytes:
    """A packet as it is sent.

    Examples
    --------
    >>> framed(b"FTK1")[:4]
    b'\\x04\\x00\\x00\\x00'
    """
    return LENGTH.pack(len(content)) + content


def connected(address: str, port: int, stop: threading.Event, pauses: tuple[float, float] = PAUSES) -> Stream:
    """Stream of a sender that listens; waits for its first packet.

    Parameters
    ----------
    address, port : of the sender.
    stop : event at which it gives up.
    pauses : before a connection is tried again, at first and at most; seconds.

    Raises
    ------
    InputError : no packet came before it was stopped.
    """
    counts = Counter[str]()

    def opened() -> socket.socket:
        return socket.create_connection((address, port), timeout=10 * PATIENCE)

    return stream_of(_packets(opened, stop, counts, pauses), f"tcp://{address}:{port}", counts)


def listening(address: str, port: int, stop: threading.Event, pauses: tuple[float, float] = (0.0, 0.0)) -> Stream:
    """Stream of whoever connects, one sender after the other; arguments as `connected`, of this machine.

    Raises
    ------
    InputError : the port cannot be had, or no packet came before it was stopped.
    """
    source, counts = f"tcp-listen://{address}:{port}", Counter[str]()
    try:
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        listener = socket.create_server((address, port), family=family)
    except (OSError, OverflowError) as error:
        raise InputError(f"{source} cannot be listened to ({getattr(error, 'strerror', None) or error}).") from error
    listener.settimeout(PATIENCE)
    return stream_of(_packets(lambda: listener.accept()[0], stop, counts, pauses), source, counts)


def _packets(
    opened: Callable[[], socket.socket], stop: threading.Event, counts: Counter[str], pauses: tuple[float, float]
) -> Iterator[Packet | None]:
    """Packets of one connection after the other, and None where none came for a while."""
    pause, broken = pauses[0], False
    while not stop.is_set():
        try:
            with opened() as connection:
                connection.settimeout(PATIENCE)
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
                for packet in _of(connection, stop, counts):
                    if packet is not None and broken:
                        counts["connected_again"] += 1
                    pause, broken = (pause, broken) if packet is None else (pauses[0], False)
                    yield packet
        except OSError:
            pass
        broken = True
        yield None
        stop.wait(pause)
        pause = min(2 * pause, pauses[1])


def _of(connection: socket.socket, stop: threading.Event, counts: Counter[str]) -> Iterator[Packet | None]:
    """Packets of a connection until it ends or makes no sense."""
    held = bytearray()
    while not stop.is_set():
        try:
            content = connection.recv(2**16)
        except TimeoutError:
            yield None
            continue
        if not content:
            return
        held += content
        while len(held) >= LENGTH.size:
            (length,) = LENGTH.unpack_from(held)
            if length > LARGEST:
                counts["malformed"] += 1
                return
            end = LENGTH.size + length
            if len(held) < end:
                break
            packet = unpack(bytes(held[LENGTH.size : end]))
            del held[:end]
            if packet is None:
                counts["malformed"] += 1
                return
            yield packet
