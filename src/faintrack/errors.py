"""The one exception that a user's input can raise."""

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """Input from outside (file, option, argument) that cannot be used.

    The message is one sentence that names the file, the field and what was expected; the command line
    prints it as it is and exits with status 2.
    """


@contextmanager
def naming(source: object) -> Iterator[None]:
    """Put the name of a file or recording before what is said of its content, unless it stands there already.

    Examples
    --------
    >>> with naming("night.wav"):
    ...     raise InputError("band reaches 3000 Hz.")
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: night.wav: band reaches 3000 Hz.
    """
    try:
        yield
    except InputError as error:
        raise error if str(error).startswith(str(source)) else InputError(f"{source}: {error}") from error
