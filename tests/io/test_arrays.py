"""Descriptions of arrays become the arrays that they describe, and back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faintrack.data.recording import from_samples
from faintrack.errors import InputError
from faintrack.io import read, read_array
from faintrack.io.arrays import array_toml, match_channels, matched
from faintrack.sensors.array import SensorArray, line_array, sensor_array

DATA = Path(__file__).parents[2].parent / "shared/data"

CHANNELS = """
sound_speed = 345
channels = [
    {name = "BRP1", x = -66.5, y = -44.5},
    {name = "BRP2", x = -32.5, y = 77.8, z = 0.0},
    {name = "BRP3", x = 88.2, y = -22.1, z = 3.0, gain = 0.5},
    {name = "BRP4", x = 10.8, y = -11.1},
]
dead = ["BRP4"]
inverted = [0, "BRP3"]
"""


def array_from(folder: Path, text: str) -> SensorArray:
    (folder / "array.toml").write_text(text, encoding="utf-8")
    return read_array(folder / "array.toml")


def test_channels(tmp_path):
    array = array_from(tmp_path, CHANNELS)
    assert array.channel_names == ("BRP1", "BRP2", "BRP3", "BRP4")
    assert array.gains.tolist() == [-1.0, 1.0, -0.5, 0.0]
    assert array.sound_speed == 345.0
    assert array.circular
    np.testing.assert_allclose(array.positions[2] - array.positions[0], [154.7, 22.4, 3.0], rtol=1e-12)


def test_line(tmp_path):
    array = array_from(tmp_path, "line = {count = 8, spacing = 0.5, heading_deg = 90}\ndead = [0]")
    expected = line_array(8, 0.5, heading=np.pi / 2)
    np.testing.assert_allclose(np.diff(array.positions, axis=0), np.diff(expected.positions, axis=0), atol=1e-12)
    np.testing.assert_allclose(array.axis, [1.0, 0.0, 0.0], atol=1e-12)
    assert (array.sound_speed, array.alive.tolist()) == (1500.0, [False] + [True] * 7)


def write_xml(path: Path) -> None:
    path.write_text(
        '<?xml version="1.0" encoding="utf-8"?>\n<MicArray name="three">\n'
        '<pos Name="a" x="0" y="0" z="0"/><pos Name="b" x="1.5" y="0" z="0"/><pos Name="c" x="0" y="2" z="0"/>\n'
        "</MicArray>",
        encoding="utf-8",
    )


def test_acoular_positions_alone_or_from_toml(tmp_path):
    write_xml(tmp_path / "three.xml")
    alone = read_array(str(tmp_path / "three.xml"))
    assert (alone.channel_names, alone.sound_speed) == (("a", "b", "c"), 343.0)
    np.testing.assert_allclose(alone.positions[1:] - alone.positions[0], [[1.5, 0, 0], [0, 2, 0]], atol=1e-12)
    table = array_from(tmp_path, 'positions_file = "three.xml"\ninverted = ["b"]')
    np.testing.assert_array_equal(table.positions, alone.positions)
    assert (table.gains.tolist(), table.sound_speed) == ([1.0, -1.0, 1.0], 343.0)
    assert array_from(tmp_path, 'positions_file = "three.xml"\nsound_speed = 340.0').sound_speed == 340.0


def test_fifty_six_microphones_of_acoular():
    folder = DATA / "acoular_airfoil_56ch"
    if not folder.is_dir():
        pytest.skip("../shared/data/acoular_airfoil_56ch is absent")
    array = read_array(folder / "array_56.xml")
    assert (len(array.channel_names), array.channel_names[0]) == (56, "Point 1")
    np.testing.assert_allclose(array.positions[1] - array.positions[0], [0.078753, -0.396736, 0], atol=1e-12)
    assert match_channels(array, read(folder / "example_data.h5")) is array


@pytest.mark.parametrize(
    "array",
    [
        line_array(32, 0.375, heading=0.3),
        sensor_array(
            np.random.default_rng(5).normal(scale=100.0, size=(6, 3)),
            345.125,
            np.array([1.0, -1.0, 0.0, 0.1 + 0.2, -2.0, 1.0]),
            ("plain", 'quo"ted', "back\\slash", "tab\t\x7f", "grün 🎤", ""),
        ),
    ],
    ids=["line", "circular"],
)
def test_toml_round_trip(tmp_path, array):
    again = array_from(tmp_path, array_toml(array))
    assert again.channel_names == array.channel_names
    assert again.sound_speed == array.sound_speed
    np.testing.assert_array_equal(again.gains, array.gains)
    # The numbers in the file are exact; centring them again may round once, at 1e-16 of the array's size.
    size = np.abs(array.positions).max()
    np.testing.assert_allclose(again.positions, array.positions, rtol=0, atol=4 * np.spacing(size))
    assert again.circular == array.circular
    if array.axis is not None:
        np.testing.assert_allclose(again.axis, array.axis, rtol=0, atol=4 * np.spacing(1.0))


def recording(*names: str):
    return replace(from_samples(np.zeros((9, len(names))), 100.0, names), source="rec.wav")


def test_channels_follow_names(tmp_path):
    array = array_from(tmp_path, CHANNELS)
    turned = match_channels(array, recording("BRP3", "BRP1", "BRP4", "BRP2"))
    order = [2, 0, 3, 1]
    assert turned.channel_names == ("BRP3", "BRP1", "BRP4", "BRP2")
    np.testing.assert_array_equal(turned.positions, array.positions[order])
    np.testing.assert_array_equal(turned.gains, array.gains[order])
    assert turned.sound_speed == array.sound_speed


def test_a_line_keeps_its_direction_when_channels_are_reordered():
    array = line_array(3, 1.0)
    np.testing.assert_array_equal(match_channels(array, recording("2", "1", "0")).axis, array.axis)


def test_channels_without_common_names_follow_by_number():
    array = line_array(3, 1.0)
    assert match_channels(array, recording("x", "y", "z")) is array


def test_numbers_of_channels_must_agree():
    with pytest.raises(InputError, match=r"^rec\.wav has 4 channels; the array has 32\.$"):
        match_channels(line_array(32, 0.375), recording("0", "1", "2", "3"))


NAMES = ("BRP1", "BRP2", "BRP3", "BRP4")


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (str, None),
        (str.lower, "their names without regard to case and blanks"),
        (lambda name: f"{name} ", "their names without regard to case and blanks"),
        (lambda name: f"{name}.EDF", "their station codes"),
        (lambda name: f"YJ.{name}.00.EDF", "their station codes"),
    ],
)
def test_names_match_by_a_rule_that_is_told(tmp_path, change, rule):
    array = array_from(tmp_path, CHANNELS)
    turned, remarks = matched(array, recording(*(change(name) for name in reversed(NAMES))))
    np.testing.assert_array_equal(turned.positions, array.positions[::-1])
    np.testing.assert_array_equal(turned.gains, array.gains[::-1])
    expected = () if rule is None else (f"Channels of the array and the recording match by {rule}.",)
    assert remarks == expected


@pytest.mark.parametrize(
    "names",
    [
        ("BRP1", "BRP2A", "BRP3", "BRP4"),
        ("BRP4", "BRP3", "BRP2", "X"),
        ("brp1", "BRP1", "BRP3", "BRP4"),
        ("BRP1.BHE", "BRP1.BHN", "BRP2.BHE", "BRP2.BHN"),
        ("w", "x", "y", "z"),
    ],
)
def test_names_that_do_not_match_are_refused_with_both_lists(tmp_path, names):
    with pytest.raises(InputError) as raised:
        matched(array_from(tmp_path, CHANNELS), recording(*names))
    assert ", ".join(names) in str(raised.value)
    assert "BRP1, BRP2, BRP3, BRP4; expected the same names." in str(raised.value)


def test_numbers_are_no_names(tmp_path):
    array = array_from(tmp_path, CHANNELS)
    assert matched(array, recording("0", "1", "2", "3")) == (array, ())
