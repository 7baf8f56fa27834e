"""Descriptions of arrays from files and back, and which channel of a recording belongs to which sensor.

`faintrack.scenario.array` shows the layout of the TOML file and says what an Acoular XML file lacks.
"""

from dataclasses import replace
from pathlib import Path

from faintrack.data.recording import Recording
from faintrack.errors import InputError, naming
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
    """Array with its channels in the order of a recording's.

    Where the recording names the same channels in another order, the array follows the names; otherwise its
    channels belong to the recording's by number.

    Raises
    ------
    InputError : the numbers of channels differ.

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
    names = array.channel_names
    if recording.channels != len(names):
        raise InputError(f"{recording.source} has {recording.channels} channels; the array has {len(names)}.")
    if len(set(names)) < len(names) or set(names) != set(recording.channel_names):
        return array
    order = [names.index(name) for name in recording.channel_names]
    return replace(
        array,
        positions=array.positions[order],
        gains=array.gains[order],
        channel_names=recording.channel_names,
    )
