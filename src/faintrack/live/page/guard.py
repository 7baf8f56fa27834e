"""Who may see the page.

On the loopback address whoever is on the machine may. A page of a stranger, open in the same browser, must not: it
would come with its own origin, or with a name of its own that it has pointed at this machine. So the host that a
browser asks for has to be this machine by a name that no stranger can have, and the origin of a socket has to be that
host. Any other address needs a token, which is compared in constant time.
"""

import hashlib
import hmac
import ipaddress
import secrets
import socket
from dataclasses import dataclass, field
from pathlib import Path

from faintrack.errors import InputError

SHORTEST = 16
"""Characters of a token at least."""


@dataclass(frozen=True)
class Guard:
    """What is asked of a request.

    Attributes
    ----------
    address : that the server listens at.
    token : that a watcher must know; None where the address is the loopback's.
    session : what a browser is given to show that it knew the token; of this process alone.
    """

    address: str
    token: bytes | None
    session: str = field(default_factory=lambda: secrets.token_hex(32))

    def host(self, header: str) -> bool:
        """Whether the host of a request is this machine, by a name that no stranger can have.

        Parameters
        ----------
        header : `Host` of the request.

        Examples
        --------
        >>> guard = guard_of("127.0.0.1")
        >>> guard.host("localhost:8080"), guard.host("[::1]:8080"), guard.host("stranger.example:8080")
        (True, True, False)
        """
        name = _name(header)
        try:
            here = ipaddress.ip_address(name).is_loopback
            return here or self.token is not None
        except ValueError:
            own = () if self.token is None else (socket.gethostname().lower(),)
            return name in ("localhost", *own)

    def origin(self, header: str | None, host: str) -> bool:
        """Whether a socket is opened by a page of this server.

        Parameters
        ----------
        header : `Origin` of the request; None where there is none.
        host : `Host` of the request.

        Examples
        --------
        >>> guard_of("127.0.0.1").origin("http://localhost:8080", "localhost:8080")
        True
        """
        return header is not None and header.lower() in (f"http://{host.lower()}", f"https://{host.lower()}")

    def knows(self, token: str) -> bool:
        """Whether a token is the one."""
        return self.token is None or hmac.compare_digest(_digest(token.encode()), _digest(self.token))

    def entered(self, session: str | None) -> bool:
        """Whether a browser has shown the token before."""
        return self.token is None or hmac.compare_digest(
            _digest((session or "").encode()), _digest(self.session.encode())
        )


def guard_of(address: str, token_file: Path | None = None) -> Guard:
    """Guard of an address.

    Parameters
    ----------
    address : that the server listens at.
    token_file : file that holds the token.

    Raises
    ------
    InputError : it is no address, the file cannot be read or holds no token, or there is none and the address is not
    the loopback's.
    """
    token = None if token_file is None else _token(token_file)
    try:
        loopback = address == "localhost" or ipaddress.ip_address(address).is_loopback
    except ValueError:
        raise InputError(f"--host is {address}; expected an address of this machine such as 127.0.0.1.") from None
    if not loopback and token is None:
        raise InputError(
            f"--host is {address}, which others can reach; expected --token-file FILE with a token of {SHORTEST} "
            "characters or more, or 127.0.0.1."
        )
    return Guard(address, token)


def _token(file: Path) -> bytes:
    try:
        with file.open("rb") as opened:
            token = opened.read(4096).strip()
    except OSError as error:
        raise InputError(f"{file} cannot be read ({error.strerror}).") from error
    if len(token) < SHORTEST or b"\n" in token:
        raise InputError(f"{file} holds no token; expected one line of {SHORTEST} characters or more.")
    return token


def _name(host: str) -> str:
    """Name or address in a `Host`, without the port."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.rpartition(":")[0].lower() if ":" in host else host.lower()


def _digest(content: bytes) -> bytes:
    # Of equal length, so that nothing tells how long the token is.
    return hashlib.sha256(content).digest()
