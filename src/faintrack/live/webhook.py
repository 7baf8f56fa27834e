"""Alarms sent to an address, signed, by a thread of their own: a receiver that is slow or away holds up nothing.

The body is the alarm's line of JSON. `X-Faintrack-Time` is when it was sent, seconds since 1970, and
`X-Faintrack-Signature` is `sha256=` and the HMAC (RFC 2104), in hexadecimal, of that time, a point, and the body, under
the secret: whoever knows the secret can tell that the alarm is ours, and that it is not an old one sent again.
"""

import hashlib
import hmac
import queue
import threading
import time
import urllib.request
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from faintrack.errors import InputError
from faintrack.live.lines import line
from faintrack.live.watch import Tell

PAUSES = (1.0, 5.0, 25.0)
"""Seconds before an alarm that was not taken is sent again."""

TIMEOUT = 5.0
"""Seconds that a receiver has to answer."""

WAITING = 100
"""Alarms that wait to be sent at most."""

SHORTEST = 16
"""Bytes of a secret at least."""


def signature(secret: bytes, sent: str, body: bytes) -> str:
    """Signature of a body that is sent at a time.

    Examples
    --------
    >>> signature(b"key", "0", b"{}")[:19]
    'sha256=7314351dd949'
    """
    return "sha256=" + hmac.new(secret, sent.encode() + b"." + body, hashlib.sha256).hexdigest()


def secret_of(file: str | Path) -> bytes:
    """Secret of a file.

    Raises
    ------
    InputError : it cannot be read, or holds none.
    """
    try:
        with Path(file).open("rb") as opened:
            secret = opened.read(4096).strip()
    except OSError as error:
        raise InputError(f"{file} cannot be read ({error.strerror}).") from error
    if len(secret) < SHORTEST:
        raise InputError(f"{file} holds no secret; expected {SHORTEST} characters or more.")
    return secret


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """An alarm goes where the scenario says, and nowhere else."""

    def redirect_request(self, *arguments: Any, **options: Any) -> None:
        return None


class Webhooks:
    """Alarms on their way.

    Parameters
    ----------
    tell : is called with an event where an alarm could not be sent.
    pauses : before each further attempt; seconds.
    """

    def __init__(self, tell: Tell, pauses: tuple[float, ...] = PAUSES) -> None:
        self._tell, self._pauses = tell, pauses
        self._queue: queue.Queue[tuple[str, bytes, Mapping[str, Any]]] = queue.Queue(WAITING)
        self._thread: threading.Thread | None = None
        self._opener = urllib.request.build_opener(_NoRedirect)

    def send(self, address: str, secret: bytes, alarm: Mapping[str, Any]) -> None:
        """Send an alarm; returns at once."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="webhooks", daemon=True)
            self._thread.start()
        try:
            self._queue.put_nowait((address, secret, alarm))
        except queue.Full:
            self._tell({"event": "webhook_failed", "name": alarm["name"], "reason": f"{WAITING} alarms wait already"})

    def finish(self, seconds: float) -> None:
        """Wait until all is sent, so many seconds at most."""
        end = time.monotonic() + seconds
        while self._queue.unfinished_tasks and time.monotonic() < end:
            time.sleep(0.05)

    def _work(self) -> None:
        while True:
            address, secret, alarm = self._queue.get()
            reason = ""
            for pause in (0.0, *self._pauses):
                time.sleep(pause)
                reason = self._posted(address, secret, line(alarm).encode())
                if not reason:
                    break
            if reason:
                self._tell({"event": "webhook_failed", "name": alarm["name"], "reason": reason})
            self._queue.task_done()

    def _posted(self, address: str, secret: bytes, body: bytes) -> str:
        """Send once; why it was not taken, or nothing."""
        sent = str(int(time.time()))
        headers = {
            "Content-Type": "application/json",
            "X-Faintrack-Time": sent,
            "X-Faintrack-Signature": signature(secret, sent, body),
        }
        request = urllib.request.Request(address, body, headers, method="POST")
        try:
            with self._opener.open(request, timeout=TIMEOUT):
                return ""
        # Whatever stands between here and there; the address may hold a secret and is not repeated.
        except Exception as error:
            return " ".join(str(error).split())[:200] or type(error).__name__
