"""Files at addresses of fsspec: listed, looked at without their samples, and fetched while they are read.

A header needs the first bytes of a file. They are put into a file that is otherwise empty and as long as the whole,
which takes no room; where a reader wants more than these, the whole is fetched.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from faintrack.errors import InputError

HEAD = 2**18
"""Bytes that are fetched of a file of which only the header is wanted."""


def is_address(path: str) -> bool:
    """Whether a path is an address of fsspec.

    Examples
    --------
    >>> is_address("s3://bucket/night"), is_address("night")
    (True, False)
    """
    return "://" in path


def listed_at(address: str) -> list[str]:
    """Files at an address: one of a folder, of a file, or a pattern.

    Raises
    ------
    InputError : nothing answers there, or a package is missing that speaks its language.

    Examples
    --------
    >>> import fsspec
    >>> with fsspec.open("memory://listed/a.wav", "wb") as file:
    ...     file.write(b"samples")
    7
    >>> listed_at("memory://listed")
    ['memory://listed/a.wav']
    """
    files, path = _opened(address)
    scheme = address.split("://", 1)[0]
    with _answering(address):
        paths = files.glob(path) if any(mark in path for mark in "*?[") else files.find(path)
    if not paths:
        raise InputError(f"{address}: there is no file.")
    return [f"{scheme}://{path.lstrip('/') if scheme != 'file' else path}" for path in sorted(paths)]


def stamp(path: str) -> str:
    """What changes when a file does: its size, and when it was written or its tag.

    Raises
    ------
    OSError : there is no such file.
    InputError : nothing answers at an address, or there is no such file.
    """
    if not is_address(path):
        found = os.stat(path)
        return f"{found.st_size} {found.st_mtime_ns}"
    files, inner = _opened(path)
    with _answering(path):
        facts = files.info(inner)
    changed = next((facts[name] for name in ("ETag", "etag", "mtime", "LastModified", "created") if name in facts), "")
    return f"{facts.get('size')} {changed}"


def is_there(path: str) -> bool:
    """Whether there is such a file."""
    try:
        stamp(path)
    except (OSError, InputError):
        return False
    return True


def size_of(mark: str) -> int:
    """Bytes of a file by its stamp."""
    text = mark.split(" ", 1)[0]
    return int(text) if text.isdigit() else 0


@contextmanager
def on_disk(paths: tuple[str, ...], head: bool = False) -> Iterator[tuple[Path, ...]]:
    """Paths at which files can be read while the block runs; those at addresses are fetched.

    Parameters
    ----------
    paths : of files, or addresses.
    head : whether only what stands first in them is wanted.

    Raises
    ------
    InputError : nothing answers at an address.
    """
    with ExitStack() as held:
        local = []
        for path in paths:
            if not is_address(path):
                local.append(Path(path))
                continue
            folder = Path(held.enter_context(tempfile.TemporaryDirectory(prefix="faintrack-")))
            files, inner = _opened(path)
            target = folder / Path(inner).name
            with _answering(path):
                if head:
                    size = int(files.info(inner)["size"])
                    target.write_bytes(files.cat_file(inner, 0, min(HEAD, size)))
                    os.truncate(target, size)
                else:
                    files.get_file(inner, str(target))
            local.append(target)
        yield tuple(local)


def _opened(address: str) -> tuple[Any, str]:
    try:
        import fsspec

        files, path = fsspec.url_to_fs(address)
    except (ImportError, ValueError) as error:
        raise InputError(f"{address} cannot be opened ({error}).") from error
    return files, path


@contextmanager
def _answering(address: str) -> Iterator[None]:
    """What goes wrong at an address is told in one sentence, whatever the language of the store."""
    try:
        yield
    # Stores share no class of errors.
    except Exception as error:
        raise InputError(f"{address} cannot be read ({' '.join(str(error).split())[:200]}).") from error
