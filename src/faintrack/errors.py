"""The one exception that a user's input can raise."""

from collections.abc import Iterator
from contextlib import contextmanager

LONGEST = 299
"""Characters of a sentence at most; of a longer one the middle is left out."""


class InputError(ValueError):
    """Input from outside (file, option, argument) that cannot be used.

    The message is one sentence that names the file, the field and what was expected; the command line
    prints it as it is and exits with status 2. What a file puts into it can do no harm: see `one_line`.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(one_line(str(message)))


def one_line(text: str) -> str:
    r"""Text of one line and at most `LONGEST` characters, control characters made visible.

    Examples
    --------
    >>> one_line("a\x1b[2J\nb"), len(one_line("x" * 1000))
    ('a\\x1b[2J\\nb', 299)
    """
    # The common case costs nothing; separators of lines and surrogates are not printable either.
    if not text.isprintable():
        shown = (each if each.isprintable() else each.encode("unicode_escape").decode() for each in text[: 4 * LONGEST])
        text = "".join(shown)
    if len(text) > LONGEST:
        half = (LONGEST - 5) // 2
        text = f"{text[:half]} ... {text[-half:]}"
    return text


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
        begins = one_line(str(source))[: LONGEST // 2 - 5]
        raise error if str(error).startswith(begins) else InputError(f"{source}: {error}") from error
