"""Samples in packets of UDP, put in order, with what was lost, late or doubled counted.

A packet is a header of 36 bytes, little-endian, and samples, the channels side by side:

===========  ===============  ==============================================================
bytes        type             what
===========  ===============  ==============================================================
0 to 3       4 letters        `FTK1`
4 to 7       whole, 32 bits   sequence number: one more than that of the packet before, then 0 again
8 to 15      whole, 64 bits   number of the first sample, counted from 0 when the sender began
16 to 23     whole, 64 bits   time of the first sample: nanoseconds since 1970, UTC
24 to 31     double           sample rate; Hz
32 to 33     whole, 16 bits   channels
34 to 35     whole, 16 bits   format: 1 for whole numbers of 16 bits, 2 for single precision
from 36      samples          as many as there are
===========  ===============  ==============================================================

A sample's place comes from its number, never from when it arrived: packets may come in any order, and what is lost is
missing. A sender that begins anew, with smaller numbers, is put in its place by its times. A packet without samples
ends the stream. Nothing in a packet is believed that the first did not say: another rate, number of channels, format or
sender is malformed, and counted.
"""

import heapq
import socket
import struct
import threading
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from faintrack.errors import InputError
from faintrack.io.limits import HIGHEST_RATE, LOWEST_RATE, MOST_CHANNELS
from faintrack.live.stream import Piece, Stream, numbered

HEADER = struct.Struct("<4sIQQdHH")
MAGIC = b"FTK1"
TYPES: dict[int, np.dtype[Any]] = {1: np.dtype("<i2"), 2: np.dtype("<f4")}
"""Number of each format."""

LARGEST = 65_535
"""Bytes of a packet of UDP."""

WINDOW = 32
"""Packets that are held back while one before them is awaited."""

PATIENCE = 0.5
"""Seconds without a packet after which those held back are handed on."""

BEGINS_ANEW = 10.0
"""Seconds by which sample numbers go back before the sender has begun anew, and is not just late."""

LONGEST_GAP = 366 * 86_400.0
"""Seconds of a gap that is believed."""


@dataclass(frozen=True)
class Packet:
    """What a packet holds.

    Attributes
    ----------
    sequence : number of the packet.
    sample : number of its first sample.
    time : of that; nanoseconds since 1970, UTC.
    sample_rate : Hz.
    values : samples; whole numbers are scaled to -1 to 1.
    format : one of `TYPES`.
    """

    sequence: int
    sample: int
    time: int
    sample_rate: float
    values: Float[np.ndarray, "sample channel"]
    format: int = 2

    def pack(self) -> bytes:
        """Its bytes.

        Examples
        --------
        >>> packet = Packet(7, 4000, 10**18, 1000.0, np.ones((2, 3), np.float32))
        >>> len(packet.pack()), unpack(packet.pack()).sample
        (60, 4000)
        """
        channels = self.values.shape[1]
        head = HEADER.pack(MAGIC, self.sequence, self.sample, self.time, self.sample_rate, channels, self.format)
        values = self.values * 32768 if self.format == 1 else self.values
        return head + values.astype(TYPES[self.format]).tobytes()


def unpack(content: bytes) -> Packet | None:
    """Packet of some bytes; None where they are none.

    Examples
    --------
    >>> unpack(b"hello") is None
    True
    """
    if len(content) < HEADER.size:
        return None
    magic, sequence, sample, time, rate, channels, form = HEADER.unpack_from(content)
    sensible = magic == MAGIC and form in TYPES and 1 <= channels <= MOST_CHANNELS and sample < 2**50
    if not (sensible and LOWEST_RATE <= rate <= HIGHEST_RATE and time < 2**63):
        return None
    held = len(content) - HEADER.size
    if held % (channels * TYPES[form].itemsize):
        return None
    values = np.frombuffer(content, TYPES[form], offset=HEADER.size).reshape(-1, channels).astype(np.float32)
    return Packet(sequence, sample, time, rate, values / np.float32(32768) if form == 1 else values, form)


def in_order(packets: Iterable[Packet | None], counts: Counter[str]) -> Iterator[Piece]:
    """Pieces of packets, in order of time.

    Parameters
    ----------
    packets : as they arrive; None where none arrived for a while.
    counts : `lost`, `late`, `doubled` and `malformed` packets and what the sender did (`begun_anew`) are added.

    Examples
    --------
    >>> def packet(number):
    ...     return Packet(number, 2 * number, 0, 1.0, np.full((2, 1), number, np.float32))
    >>> counts = Counter()
    >>> arrived = [packet(number) for number in (0, 2, 1, 1, 4)] + [None, packet(3)]
    >>> [(piece.time, piece.gap) for piece in in_order(arrived, counts)], dict(counts)
    ([(0.0, 0), (2.0, 0), (4.0, 0), (8.0, 2)], {'doubled': 1, 'lost': 1, 'late': 1})
    """
    waiting: list[tuple[int, int, Packet]] = []
    held: set[int] = set()
    recent: dict[int, None] = {}
    first: Packet | None = None
    shift, end, sequence = 0, 0, 0

    def release() -> Iterator[Piece]:
        nonlocal end, sequence
        place, _, packet = heapq.heappop(waiting)
        held.discard(place)
        lost = (packet.sequence - sequence) % 2**32
        gap = max(0, place - end)
        # A sender may leave samples out without a packet that is lost.
        if gap and 0 < lost < 2**31:
            counts["lost"] += lost
        values = packet.values[max(0, end - place) :]
        if len(values):
            yield Piece((end + gap) / packet.sample_rate, values, gap)
        end, sequence = end + gap + len(values), packet.sequence + 1
        recent[place] = None
        if len(recent) > 4 * WINDOW:
            del recent[next(iter(recent))]

    for packet in packets:
        if packet is None:
            while waiting:
                yield from release()
            continue
        if first is None:
            first, shift, sequence = packet, packet.sample, packet.sequence
        like = (packet.sample_rate, packet.values.shape[1], packet.format)
        if like != (first.sample_rate, first.values.shape[1], first.format):
            counts["malformed"] += 1
            continue
        if not len(packet.values):
            break
        place = packet.sample - shift
        if end - place > BEGINS_ANEW * packet.sample_rate:
            while waiting:
                yield from release()
            # By the sender's clock; one that was set back leaves no gap that is known.
            by_clock = round((packet.time - first.time) * 1e-9 * packet.sample_rate)
            place = max(end, by_clock)
            shift, sequence = packet.sample - place, packet.sequence
            counts["begun_anew"] += 1
        if place - end > LONGEST_GAP * packet.sample_rate:
            counts["malformed"] += 1
        elif place in held or place in recent:
            counts["doubled"] += 1
        elif place < end:
            counts["late"] += 1
        else:
            heapq.heappush(waiting, (place, packet.sequence, packet))
            held.add(place)
            while waiting and (waiting[0][0] == end or len(waiting) > WINDOW):
                yield from release()
    while waiting:
        yield from release()


def datagrams(address: str, port: int, stop: threading.Event) -> Stream:
    """Stream of the packets that arrive at a port; waits for the first one.

    Parameters
    ----------
    address : of this machine, "127.0.0.1" for senders on it.
    port : of UDP.
    stop : event at which it gives up.

    Raises
    ------
    InputError : the port cannot be had.
    """
    source, counts = f"udp://{address}:{port}", Counter[str]()
    try:
        receiver = socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET, socket.SOCK_DGRAM)
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**22)
        receiver.bind((address, port))
    except (OSError, OverflowError) as error:
        raise InputError(f"{source} cannot be listened to ({getattr(error, 'strerror', None) or error}).") from error
    receiver.settimeout(PATIENCE)
    arrived = _received(receiver, stop, counts)
    return stream_of(arrived, source, counts)


def stream_of(arrived: Iterator[Packet | None], source: str, counts: Counter[str]) -> Stream:
    """Stream of packets as they arrive; waits for the first one.

    Parameters
    ----------
    arrived : packets, and None where none arrived for a while.
    source : where they come from, for messages.
    counts : what goes wrong is added.

    Raises
    ------
    InputError : no packet comes.
    """
    first = next((packet for packet in arrived if packet is not None), None)
    if first is None:
        raise InputError(f"{source}: no packet came.")

    def packets() -> Iterator[Packet | None]:
        yield first
        yield from arrived

    return Stream(
        in_order(packets(), counts),
        first.sample_rate,
        numbered(first.values.shape[1]),
        source,
        np.datetime64(first.time, "ns"),
        counts=counts,
    )


def _received(receiver: socket.socket, stop: threading.Event, counts: Counter[str]) -> Iterator[Packet | None]:
    """Packets of the first sender, and None where none came for a while."""
    sender = None
    with receiver:
        while not stop.is_set():
            try:
                content, (host, *_) = receiver.recvfrom(LARGEST)
            except TimeoutError:
                yield None
                continue
            packet = unpack(content) if sender in (None, host) else None
            if packet is None:
                counts["malformed"] += 1
                continue
            sender = host
            yield packet
