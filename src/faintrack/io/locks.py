"""One writer at a time: locks that the system drops with the process that holds them."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes]) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


class Held(Exception):
    """Another process holds the lock."""


@contextmanager
def locked(path: Path, keep: bool = False) -> Iterator[None]:
    """Hold a lock while the block runs.

    Parameters
    ----------
    path : of the file that is the lock; made where it is not there.
    keep : whether the file stays afterwards.

    Raises
    ------
    Held : another process holds it.
    OSError : the file cannot be made.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder, locked(Path(folder) / "lock"):
    ...     try:
    ...         with locked(Path(folder) / "lock"):
    ...             print("both")
    ...     except Held:
    ...         print("one")
    one
    """
    while True:
        file = path.open("ab")
        try:
            _lock(file)
        except OSError as error:
            file.close()
            raise Held(str(path)) from error
        # Whoever held it before may have removed the file since it was opened here.
        if path.exists() and os.path.samestat(os.fstat(file.fileno()), path.stat()):
            break
        file.close()
    with file:
        try:
            yield
        finally:
            if not keep and sys.platform != "win32":
                path.unlink(missing_ok=True)
