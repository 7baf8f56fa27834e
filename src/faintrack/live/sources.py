"""From what a person writes as a source to its stream."""

import math
import stat
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.kinds.door import Given, kind_of_files
from faintrack.live.bytestream import Raw, growing_file, named_pipe, standard_input
from faintrack.live.packets import datagrams
from faintrack.live.replay import replay
from faintrack.live.stream import Stream
from faintrack.live.tcp import connected, listening

FORMS = (
    "- (standard input), a named pipe or file, udp://ADDRESS:PORT, tcp://ADDRESS:PORT, tcp-listen://ADDRESS:PORT "
    "or replay FILE"
)
"""Sources, as a message lists them."""

NETWORK = {"udp": datagrams, "tcp": connected, "tcp-listen": listening}
"""How packets come, by the scheme of an address."""


def raw_of(channels: int | None, rate: float | None, form: str | None) -> Raw | None:
    """What bytes without a header hold; None where nothing was given, and a header tells.

    Raises
    ------
    InputError : only a part was given.

    Examples
    --------
    >>> raw_of(8, 4000.0, None)
    Raw(channels=8, sample_rate=4000.0, format='float32')
    """
    if channels is None and rate is None and form is None:
        return None
    if channels is None or rate is None:
        raise InputError("raw samples need --channels and --rate, both; a WAV stream needs neither.")
    return Raw(channels, rate, form or "float32")


def is_stored(words: Sequence[str]) -> bool:
    """Whether the samples of a source are in a file, and so can be read from where an earlier run stopped.

    Examples
    --------
    >>> is_stored(["replay", "night.wav"]), is_stored(["-"])
    (True, False)
    """
    return words[0] == "replay" or (len(words) == 1 and Path(words[0]).is_file())


def kind_of_source(words: Sequence[str], given: Given) -> str:
    """Kind of the data that come from a source: what the scenario or the files tell, otherwise a recording.

    Parameters
    ----------
    words : as `opened_stream`.
    given : of the scenario.

    Examples
    --------
    >>> kind_of_source(["-"], Given({"kind": "bearings"})), kind_of_source(["-"], Given({}))
    ('bearings', 'recording')
    """
    if given.kind is not None:
        return given.kind
    path = Path(words[0])
    if len(words) == 1 and (path.is_file() or path.is_dir()):
        try:
            return kind_of_files((path,), given).name
        except InputError:
            # Raw samples have names that tell nothing.
            return "recording"
    return "recording"


def opened_stream(
    words: Sequence[str], scenario: Any, stop: threading.Event, raw: Raw | None, speed: float | None, start: int = 0
) -> Stream:
    """Stream of a source.

    Parameters
    ----------
    words : as on the command line: one word, or "replay" and files of one recording.
    scenario : of a kind whose data are samples.
    stop : event at which the stream gives up.
    raw : what bytes without a header hold.
    speed : of a replay; 1 where not given.
    start : number of the sample to begin with, of a source that is stored.

    Raises
    ------
    InputError : it is no source, or cannot be opened.
    """
    if speed is not None and not (words[0] == "replay" and speed > 0 and not math.isnan(speed)):
        raise InputError("--speed is of replay FILE, and a number above 0.")
    if words[0] == "replay":
        return _replayed(words[1:], scenario, stop, 1.0 if speed is None else speed, start)
    if len(words) > 1:
        raise InputError(f"there are {len(words)} sources; expected one: {FORMS}.")
    word = words[0]
    for scheme, opens in NETWORK.items():
        if word.startswith(f"{scheme}://"):
            return opens(*address_of(word, scheme), stop)
    if word == "-":
        return standard_input(stop, raw)
    path = Path(word)
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        raise InputError(f"{word} does not exist; expected {FORMS}.") from None
    if stat.S_ISFIFO(mode):
        return named_pipe(path, stop, raw)
    if stat.S_ISREG(mode):
        return growing_file(path, stop, raw, start)
    raise InputError(f"{word} is a folder or a device; expected {FORMS}.")


def _replayed(files: Sequence[str], scenario: Any, stop: threading.Event, speed: float, start: int) -> Stream:
    if not files:
        raise InputError("replay needs a file: replay FILE.")
    for file in files:
        if not Path(file).exists():
            raise InputError(f"{file} does not exist.")
    recording = kind_named(scenario.kind).read(tuple(map(Path, files)), scenario)
    if start >= recording.length:
        raise InputError(f"{recording.source} was played to its end before; expected another folder for --out.")
    return replay(recording, speed, stop, start)


def address_of(word: str, scheme: str) -> tuple[str, int]:
    """Address and port of a source."""
    address, colon, port = word.removeprefix(f"{scheme}://").rpartition(":")
    if not (colon and address and port.isdecimal() and len(port) <= 5 and 0 < int(port) < 2**16):
        raise InputError(f"{word} is no address; expected {scheme}://ADDRESS:PORT such as {scheme}://127.0.0.1:9000.")
    return address.strip("[]"), int(port)
