"""Lines of CSV that come, on standard input or over TCP, kept in a file that grows.

The file is what is read (`faintrack.live.growing`), so that the numbers are those of a file with these lines. A run
that goes on adds to the file of the run before; a header that comes again is left out.
"""

import socket
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from faintrack.errors import InputError

PATIENCE = 10.0
"""Seconds that a connection may take to be made."""


def standard_lines() -> Iterator[bytes]:
    """Yield the lines of standard input."""
    yield from sys.stdin.buffer


def connected_lines(address: str, port: int) -> Iterator[bytes]:
    """Lines of a sender that listens, until it ends.

    Parameters
    ----------
    address, port : of the sender.

    Raises
    ------
    InputError : there is nobody.
    """
    try:
        connection = socket.create_connection((address, port), timeout=PATIENCE)
    except OSError as error:
        raise InputError(f"tcp://{address}:{port} cannot be connected to ({error.strerror or error}).") from error
    connection.settimeout(None)

    def lines() -> Iterator[bytes]:
        # A connection that breaks is the end of its lines, and the line that was cut is none.
        with connection, connection.makefile("rb") as content, suppress(OSError):
            yield from (line for line in content if line.endswith(b"\n"))

    return lines()


def kept(lines: Iterable[bytes], file: Path, stop: threading.Event) -> None:
    """Write lines to a file as they come, in a thread of its own; `stop` is set at their end.

    Parameters
    ----------
    lines : as they come.
    file : that is made, or added to after its last whole line.
    stop : event that the end of the lines sets.
    """
    file.touch()
    whole = file.read_bytes().rpartition(b"\n")
    header = whole[0].partition(b"\n")[0].strip()
    with file.open("rb+") as cut:
        cut.truncate(len(whole[0]) + len(whole[1]))

    def copy() -> None:
        try:
            with file.open("ab") as out:
                for number, line in enumerate(lines):
                    if number == 0 and header and line.strip() == header:
                        continue
                    out.write(line)
                    out.flush()
        finally:
            stop.set()

    threading.Thread(target=copy, name="lines", daemon=True).start()
