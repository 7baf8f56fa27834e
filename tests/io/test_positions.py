"""Positions from tables and seismic headers: metres on a plane, and a sentence where something is not told."""

import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.io.positions import read_positions

METRES = np.array([[-66.5, -44.5, 0.0], [-32.5, 77.8, 0.0], [88.2, -22.1, 3.0]])


def degrees(metres, latitude=49.0, longitude=179.9999):
    """By a sphere's radii of curvature on WGS84, of its own; right to a millimetre for 100 m."""
    a, f = 6378137.0, 1 / 298.257223563
    e2, phi = f * (2 - f), np.radians(latitude)
    w = np.sqrt(1 - e2 * np.sin(phi) ** 2)
    north, east = a * (1 - e2) / w**3, a / w * np.cos(phi)
    longitudes = (longitude + np.degrees(metres[:, 0] / east) + 180) % 360 - 180
    return np.stack([latitude + np.degrees(metres[:, 1] / north), longitudes], axis=1)


def centred(array):
    return array.positions - array.positions.mean(axis=0), METRES - METRES.mean(axis=0)


def test_metres(tmp_path):
    rows = "".join(f"{name},{x},{y},{z}\n" for name, (x, y, z) in zip("abc", METRES, strict=True))
    (tmp_path / "a.csv").write_text("Name,X_m,Y_m,Z_m\n" + rows)
    array = read_positions(tmp_path / "a.csv", sound_speed=340.0)
    np.testing.assert_allclose(*centred(array), atol=1e-9)
    assert (array.channel_names, array.sound_speed) == (("a", "b", "c"), 340.0)


def test_degrees_on_the_date_line(tmp_path):
    pytest.importorskip("pyproj")
    rows = zip("abc", degrees(METRES), METRES[:, 2], strict=True)
    text = "".join(f"{name};{lat:.9f};{lon:.9f};{z}\n" for name, (lat, lon), z in rows).replace(".", ",")
    (tmp_path / "a.csv").write_text("name;lat;lon;elevation_m\n" + text)
    array = read_positions(tmp_path / "a.csv", sound_speed=340.0)
    # Nine digits of a degree are 0.1 mm.
    np.testing.assert_allclose(*centred(array), atol=2e-3)


def test_sac_headers(tmp_path):
    pytest.importorskip("pyproj")
    sac = pytest.importorskip("obspy.io.sac")
    for name, (lat, lon), z in zip("ABC", degrees(METRES, longitude=10.0), METRES[:, 2], strict=True):
        trace = sac.SACTrace(data=np.zeros(9, "f4"), delta=0.01, kstnm=name, stla=lat, stlo=lon, stel=z)
        trace.write(str(tmp_path / f"{name}.sac"))
    files = sorted(tmp_path.glob("*.sac"))
    array = read_positions(*files, sound_speed=340.0)
    # Single precision of 49 degrees is 0.4 m.
    np.testing.assert_allclose(*centred(array), atol=0.5)
    assert array.channel_names == ("A", "B", "C")
    sac.SACTrace(data=np.zeros(9, "f4"), delta=0.01, kstnm="D").write(str(tmp_path / "D.sac"))
    with pytest.raises(InputError, match=r"D\.sac tells no place of its station"):
        read_positions(*files, tmp_path / "D.sac", sound_speed=340.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name,x_m\na,1\n", "there is no column y_m"),
        ("x_m,y_m\n1,2\n", "there is no column name"),
        ("name,x_m,y_m,lat\na,1,2,3\n", "columns in metres and in degrees"),
        ("name,x_m,y_m\na,1,2\na,3,4\n", "channel a comes twice"),
        ("name,x_m,y_m\na,1,2\nb,3e9,4\n", "from the middle; expected at most"),
        ("name,x_m,y_m\na,1,2\nb,inf,4\n", "expected a number"),
        ("name,lat,lon\na,91,2\nb,3,4\n", "beyond the earth"),
        ("name,x_m,y_m\na,1,2\n", "the array has 1 channels in use; expected at least 2"),
    ],
)
def test_tables_that_tell_no_array(tmp_path, text, expected):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=expected) as raised:
        read_positions(tmp_path / "a.csv", sound_speed=340.0)
    assert str(raised.value).startswith(str(tmp_path / "a.csv"))
