"""Tracks as sentences of NMEA 0183, for chart plotters and bridges: `$RATTM`, one a track and scan.

A track of an array has a bearing and no range; its fields of distance, speed and course are empty, and so is what
follows from them. Only bearings from true north are sent: those from the axis of a line are on one of two sides.
"""

import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from faintrack.errors import InputError


def sentence(body: str) -> str:
    """A sentence with its checksum, the exclusive or of all characters between `$` and `*`.

    Examples
    --------
    >>> sentence("GPGLL,5057.970,N,00146.110,E,142451,A")
    '$GPGLL,5057.970,N,00146.110,E,142451,A*27\\r\\n'
    """
    check = 0
    for byte in body.encode("ascii"):
        check ^= byte
    return f"${body}*{check:02X}\r\n"


def target_messages(event: Mapping[str, Any]) -> Iterator[str]:
    """Yield a `$RATTM` for every track of a scan.

    The number of a target has two digits: labels go round after 99. The status is T, tracking.

    Parameters
    ----------
    event : of the scan, see `faintrack.live.lines.event_of`.

    Examples
    --------
    >>> event = {"utc": "2026-05-01T14:24:51.250Z", "tracks": [{"label": 104, "bearing_deg": -10.04}]}
    >>> [message] = target_messages(event)
    >>> message
    '$RATTM,05,,350.0,T,,,T,,,N,104,T,,142451.25,A*1F\\r\\n'
    """
    utc = str(event.get("utc", ""))
    clock = utc[11:22].replace(":", "") if utc else ""
    for track in event["tracks"]:
        bearing = round(float(track["bearing_deg"]) % 360, 1) % 360
        label = int(track["label"])
        number = (label - 1) % 99 + 1
        yield sentence(f"RATTM,{number:02d},,{bearing:.1f},T,,,T,,,N,{label},T,,{clock},A")


@contextmanager
def sender(where: str) -> Iterator[Callable[[str], None]]:
    """Function that sends sentences to an address of UDP, or adds them to a file.

    Parameters
    ----------
    where : udp://ADDRESS:PORT, or a path.

    Raises
    ------
    InputError : it is no address, or the file cannot be written.
    """
    if not where.startswith("udp://"):

        def write(text: str) -> None:
            # Opened for each, so that whoever reads the file may take it away.
            with Path(where).open("a", encoding="ascii", newline="") as file:
                file.write(text)

        try:
            write("")
        except OSError as error:
            raise InputError(f"{where} cannot be written ({error.strerror}).") from error
        yield write
        return
    host, colon, port = where.removeprefix("udp://").rpartition(":")
    if not (colon and host and port.isdecimal() and len(port) <= 5 and 0 < int(port) < 2**16):
        raise InputError(f"{where} is no address; expected udp://ADDRESS:PORT such as udp://127.0.0.1:10110.")
    host = host.strip("[]")
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM) as outgoing:
        outgoing.setblocking(False)
        outgoing.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)

        def send(text: str) -> None:
            # A plotter that is away, or a network that is full, holds up nothing.
            with suppress(OSError):
                outgoing.sendto(text.encode("ascii"), (host, int(port)))

        yield send
