"""The table that describes an array, in a file of its own or as `[array]` of a scenario.

Positions are given in exactly one of three ways: every channel, a uniform line, or a file of Acoular.

.. code-block:: toml

    sound_speed = 345.0            # m/s; 1500 where not given, 343 with positions_file
    channels = [                   # metres east, north, up; z is 0 and gain 1 where not given
        {name = "BRP1", x = -66.5, y = -44.5},
        {name = "BRP2", x = -32.5, y = 77.8, z = 2.0, gain = 0.5},
    ]
    # line = {count = 32, spacing = 0.375, heading_deg = 0.0}     # metres; degrees clockwise from north
    # positions_file = "array_56.xml"                             # relative to the folder of this file
    dead = ["BRP2"]                # names, or channel numbers from 0
    inverted = [0]

Acoular's files hold microphone arrays and no sound speed, hence 343 m/s for them, the speed that Acoular
assumes. Its x, y and z are taken as east, north and up.
"""

import math
from pathlib import Path
from typing import Annotated, Any
from xml.etree import ElementTree

import numpy as np
from pydantic import BeforeValidator, Field, PlainValidator, model_validator

from faintrack.errors import InputError
from faintrack.scenario.section import FilePath, Section, read_toml, validated
from faintrack.sensors.array import SensorArray, line_array, sensor_array

_WATER = 1500.0
_AIR = 343.0


def _name_or_number(value: Any) -> int | str:
    if isinstance(value, bool) or not isinstance(value, int | str):
        raise ValueError("expected the name of a channel or its number from 0")
    return value


_ChannelKeys = list[Annotated[int | str, PlainValidator(_name_or_number)]]


class ChannelDescription(Section):
    """One channel: its name, position in metres east, north, up, and the factor that corrects it."""

    name: str
    x: float
    y: float
    z: float = 0.0
    gain: float = 1.0


class LineDescription(Section):
    """A uniform line: channels, spacing in metres, heading in degrees clockwise from north."""

    count: int = Field(ge=2)
    spacing: float = Field(gt=0)
    heading_deg: float = 0.0


class ArrayDescription(Section):
    """An array as a file describes it; `build` turns it into a SensorArray."""

    sound_speed: float | None = Field(default=None, gt=0)
    channels: list[ChannelDescription] | None = None
    line: LineDescription | None = None
    positions_file: FilePath | None = None
    dead: _ChannelKeys = Field(default_factory=list)
    inverted: _ChannelKeys = Field(default_factory=list)

    @model_validator(mode="after")
    def _one_geometry(self) -> "ArrayDescription":
        found = [name for name in ("channels", "line", "positions_file") if getattr(self, name) is not None]
        if len(found) != 1:
            listed = " and ".join(found) or "none"
            raise ValueError(f"expected exactly one of channels, line and positions_file; found {listed}")
        return self


def build(description: ArrayDescription) -> SensorArray:
    """Array that a description describes.

    Parameters
    ----------
    description : the validated section.

    Raises
    ------
    InputError : `dead` or `inverted` name no channel, the positions file cannot be read, or the positions make
        no array (see `sensor_array`).

    Examples
    --------
    >>> array = build(ArrayDescription(line={"count": 4, "spacing": 0.5}, inverted=[3]))
    >>> array.gains.tolist(), array.sound_speed
    ([1.0, 1.0, 1.0, -1.0], 1500.0)
    """
    speed = description.sound_speed or (_WATER if description.positions_file is None else _AIR)
    gains = None
    if description.line is not None:
        line = description.line
        array = line_array(line.count, line.spacing, speed, math.radians(line.heading_deg))
        positions, names = array.positions, array.channel_names
    elif description.positions_file is not None:
        positions, names = read_positions(Path(description.positions_file))
    else:
        channels = description.channels or []
        positions = np.array([[c.x, c.y, c.z] for c in channels]).reshape(-1, 3)
        names = tuple(c.name for c in channels)
        gains = np.array([c.gain for c in channels])
    gains = np.ones(len(names)) if gains is None else gains
    gains[_numbers("inverted", description.inverted, names)] *= -1
    gains[_numbers("dead", description.dead, names)] = 0
    return sensor_array(positions, speed, gains, names)


def read_description(path: str | Path) -> ArrayDescription:
    """Description of an array in a TOML file, or in an XML file of Acoular.

    Parameters
    ----------
    path : a file that ends in .toml or .xml.

    Raises
    ------
    InputError : the file is missing, unknown, or not valid.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".toml", ".xml"):
        raise InputError(f"{path}: unknown kind of array file; expected .toml or .xml.")
    content = {"positions_file": path.name} if suffix == ".xml" else read_toml(path)
    return validated(ArrayDescription, content, path, path.parent)


def _described(value: Any, info: Any) -> Any:
    """What stands for an array: an array itself, or the name of its file."""
    if isinstance(value, SensorArray):
        return describe(value)
    if isinstance(value, str | Path):
        folder = (info.context or {}).get("folder")
        return read_description(value if folder is None else Path(folder) / value)
    return value


ArraySection = Annotated[ArrayDescription, BeforeValidator(_described)]
"""An array in a scenario: a table, the name of a file with it, or in Python a `SensorArray`."""


def describe(array: SensorArray) -> ArrayDescription:
    """Description of an array, channel by channel; `build` gives the same array back.

    Examples
    --------
    >>> describe(line_array(count=2, spacing=3.0)).channels[0].y
    -1.5
    """
    columns = array.channel_names, array.positions.tolist(), array.gains.tolist()
    channels = [
        ChannelDescription(name=name, x=x, y=y, z=z, gain=gain) for name, (x, y, z), gain in zip(*columns, strict=True)
    ]
    return ArrayDescription(sound_speed=array.sound_speed, channels=channels)


def read_positions(path: Path) -> tuple[np.ndarray, tuple[str, ...]]:
    """Positions and names of the channels in an array file of Acoular.

    Parameters
    ----------
    path : XML with one `<pos Name="..." x="..." y="..." z="..."/>` for each channel; metres.

    Returns
    -------
    Positions of shape (channel, 3) in metres, and the names; channels without a name are numbered from 0.

    Raises
    ------
    InputError : the file is missing or not such XML.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except OSError as error:
        raise InputError(f"{path}: the positions cannot be read ({error.strerror}).") from error
    # ValueError: an encoding that does not exist.
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path} is not valid XML ({error}).") from error
    places = root.findall("pos")
    if not places:
        raise InputError(f"{path} holds no positions; expected <pos Name x y z/> within <{root.tag}>.")
    positions = np.array([[_coordinate(path, i, place, axis) for axis in "xyz"] for i, place in enumerate(places)])
    return positions, tuple(place.get("Name", str(i)) for i, place in enumerate(places))


def _numbers(field: str, keys: list[int | str], names: tuple[str, ...]) -> list[int]:
    """Numbers of the channels that `dead` or `inverted` list."""
    numbers: list[int] = []
    for key in keys:
        found = [i for i, name in enumerate(names) if key in (i, name)]
        if not found:
            listed = ", ".join(names)
            raise InputError(f"{field} lists {key!r}; the channels are {listed}, or by number from 0.")
        numbers += found
    return numbers


def _coordinate(path: Path, number: int, place: ElementTree.Element, axis: str) -> float:
    text = place.get(axis, "")
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{path}: {axis} of position {number} is {text!r}; expected metres.") from error
