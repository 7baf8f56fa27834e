"""Descriptions of arrays from files and back, and which channel of a recording belongs to which sensor.

`faintrack.scenario.array` shows the layout of the TOML file and says what an Acoular XML file lacks.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from faintrack.data.recording import Recording
from faintrack.errors import InputError, naming
from faintrack.io.checks import require_file
from faintrack.scenario.array import build, describe, read_description
from faintrack.scenario.section import to_toml
from faintrack.sensors.array import SensorArray


def read_array(path: str | Path) -> SensorArray:
    """Array of a TOML description, or of an Acoular XML file with 343 m/s as its sound speed.

    Parameters
    ----------
    path : a file that ends in .toml or .xml.

    Raises
    ------
    InputError : the file is missing, not valid, or describes no array; the sentence names file and field.

    Examples
    --------
    >>> read_array("array.csv")
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: array.csv: unknown kind of array file; expected .toml or .xml.
    """
    path = Path(path)
    if path.suffix.lower() in (".toml", ".xml"):
        require_file(path)
    with naming(path):
        return build(read_description(path))


def array_toml(array: SensorArray) -> str:
    """TOML text that describes an array; `read_array` gives the same array back.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> print(array_toml(line_array(count=2, spacing=3.0)).splitlines()[0])
    sound_speed = 1500.0
    """
    return to_toml(describe(array))


def match_channels(array: SensorArray, recording: Recording) -> SensorArray:
    """Array with its channels in the order of a recording's, see `matched`.

    Raises
    ------
    InputError : the numbers of channels differ, or names do not match.

    Examples
    --------
    >>> import numpy as np
    >>> from faintrack.data.recording import from_samples
    >>> from faintrack.sensors.array import sensor_array
    >>> array = sensor_array(np.array([[0, 0], [0, 2]]), channel_names=("south", "north"))
    >>> turned = match_channels(array, from_samples(np.zeros((9, 2)), 100.0, ("north", "south")))
    >>> turned.channel_names, turned.positions[:, 1].tolist()
    (('north', 'south'), [1.0, -1.0])
    """
    return matched(array, recording)[0]


def matched(array: SensorArray, recording: Recording) -> tuple[SensorArray, tuple[str, ...]]:
    """Array with its channels in the order of a recording's, and by which rule, where that is not plain.

    Names match whole; otherwise without regard to case and blanks; otherwise by what both have of a station's codes:
    `BRP1` is `YJ.BRP1..EDF`, as long as no two channels share it. Channels belong to each other by their number only
    where one side has no names but numbers.

    Parameters
    ----------
    array : as described.
    recording : as read.

    Raises
    ------
    InputError : the numbers of channels differ, or names do not match; the sentence has both lists.

    Examples
    --------
    >>> import numpy as np
    >>> from faintrack.data.recording import from_samples
    >>> from faintrack.sensors.array import sensor_array
    >>> array = sensor_array(np.array([[0, 0], [0, 2]]), channel_names=("a1", "A2 "))
    >>> matched(array, from_samples(np.zeros((9, 2)), 100.0, ("A2", "A1")))[1]
    ('Channels of the array and the recording match by their names without regard to case and blanks.',)
    """
    names, own = array.channel_names, recording.channel_names
    if recording.channels != len(names):
        raise InputError(f"{recording.source} has {recording.channels} channels; the array has {len(names)}.")
    for rule, key in _RULES:
        keys, wanted = [key(name) for name in names], [key(name) for name in own]
        # Rules may be met by one name in several ways: `A.BHE` is not `A`, where there is `A.BHN`.
        if len(set(keys)) == len(keys) and set(keys) == set(wanted):
            order = [keys.index(each) for each in wanted]
            said = (f"Channels of the array and the recording match by {rule}.",) if rule else ()
            return _in_order(array, order, own), said
    if all(name.isdecimal() for name in names) or all(name.isdecimal() for name in own):
        return array, ()
    raise InputError(
        f"{recording.source} has the channels {_shown(own)}, the array {_shown(names)}; expected the same names."
    )


def _station(name: str) -> str:
    """The station of "network.station.location.channel", of "station.channel", or of "station"."""
    codes = name.strip().casefold().split(".")
    return codes[1] if len(codes) == 4 else codes[0]


_RULES: tuple[tuple[str, Callable[[str], str]], ...] = (
    ("", str),
    ("their names without regard to case and blanks", lambda name: name.strip().casefold()),
    ("their station codes", _station),
)


def _in_order(array: SensorArray, order: list[int], names: tuple[str, ...]) -> SensorArray:
    if order == list(range(len(order))) and names == array.channel_names:
        return array
    return replace(array, positions=array.positions[order], gains=array.gains[order], channel_names=names)


def _shown(names: tuple[str, ...]) -> str:
    """Names as a list that a sentence has room for."""
    shown = ", ".join(names[:8])
    return f"{shown[:80]}{', ...' if len(names) > 8 or len(shown) > 80 else ''}"
