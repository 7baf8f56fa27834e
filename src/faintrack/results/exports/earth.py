"""Tracks on a globe: KML of Google Earth and QGIS, CZML of Cesium. Both show them over time, with ellipses.

KML: a `gx:Track` each where UTC is known, otherwise a line; of a track at most `ELLIPSES` ellipses, each with its time.
CZML knows times in UTC only; the ellipse moves and turns with its target.
"""

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from faintrack.results.exports import require_earth, require_utc
from faintrack.results.exports.ellipse import axes_of, outline
from faintrack.results.result import Result
from faintrack.results.track import Track

ELLIPSES = 60
"""Of a track in KML at most, evenly chosen."""

_KML, _GX = "http://www.opengis.net/kml/2.2", "http://www.google.com/kml/ext/2.2"
_ORANGE = (213, 94, 0)


def write_kml(path: Path, result: Result) -> None:
    """Write KML 2.2.

    Raises
    ------
    InputError : the result has no place on earth.
    """
    require_earth(result, "KML")
    ElementTree.register_namespace("", _KML)
    ElementTree.register_namespace("gx", _GX)
    root = ElementTree.Element(f"{{{_KML}}}kml")
    document = _put(root, "Document")
    _put(document, "name", str(result.data.attrs["source"]))
    colour = "{2:02x}{1:02x}{0:02x}".format(*_ORANGE)
    style = _put(document, "Style", id="track")
    for part, opacity, width in (("LineStyle", "ff", "2"), ("PolyStyle", "40", None)):
        one = _put(style, part)
        _put(one, "color", opacity + colour)
        if width:
            _put(one, "width", width)
    for track in result.tracks:
        folder = _put(document, "Folder")
        _put(folder, "name", f"track {track.label}")
        _line(folder, track)
        ellipses = _put(folder, "Folder")
        _put(ellipses, "name", "where the target is with 95 %")
        utc = utc_texts(track)
        for scan in np.unique(np.linspace(0, len(track.time) - 1, ELLIPSES).round().astype(int)):
            mark = _put(ellipses, "Placemark")
            _put(mark, "name", f"{track.time[scan]:g} s")
            if utc is not None:
                _put(_put(mark, "TimeStamp"), "when", utc[scan])
            _put(mark, "styleUrl", "#track")
            ring = _put(_put(_put(mark, "Polygon"), "outerBoundaryIs"), "LinearRing")
            _put(ring, "coordinates", " ".join(f"{x:.7f},{y:.7f}" for x, y in outline(track, int(scan))))
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def write_czml(path: Path, result: Result) -> None:
    """Write CZML 1.0.

    Raises
    ------
    InputError : the result has no place on earth, or does not know UTC.
    """
    require_earth(result, "CZML")
    require_utc(result, "CZML")
    document: dict[str, Any] = {"id": "document", "name": str(result.data.attrs["source"]), "version": "1.0"}
    if result.tracks:
        ends = [f"{np.datetime_as_string(find(_utc(t)), unit='ms')}Z" for find, t in _first_and_last(result.tracks)]
        document["clock"] = {"interval": "/".join(ends), "currentTime": ends[0], "multiplier": 10}
    packets = [document, *(_packet(track) for track in result.tracks)]
    path.write_text(json.dumps(packets, allow_nan=False) + "\n", encoding="utf-8")


def utc_texts(track: Track) -> list[str] | None:
    """Times of a track as ISO 8601; None where they are not known."""
    utc = track.utc
    return None if utc is None else [f"{text}Z" for text in np.datetime_as_string(utc, unit="ms")]


def _line(folder: ElementTree.Element, track: Track) -> None:
    """Placemark with the way of a target."""
    mark = _put(folder, "Placemark")
    _put(mark, "name", f"track {track.label}")
    _put(mark, "description", f"existence up to {track.existence_max:.4f}")
    _put(mark, "styleUrl", "#track")
    places = list(zip(track.earth["longitude"], track.earth["latitude"], strict=True))
    utc = utc_texts(track)
    if utc is not None:
        way = _put(mark, "Track", space=_GX)
        for text in utc:
            _put(way, "when", text)
        for x, y in places:
            _put(way, "coord", f"{x:.7f} {y:.7f} 0", space=_GX)
        return
    # A line of one point is none.
    line = _put(mark, "LineString" if len(places) > 1 else "Point")
    _put(line, "coordinates", " ".join(f"{x:.7f},{y:.7f}" for x, y in places))


def _packet(track: Track) -> dict[str, Any]:
    """A track of CZML. An ellipse is turned counter-clockwise from north."""
    times = utc_texts(track)
    assert times is not None, "UTC is known"
    since = np.asarray(track.time - track.time[0], float)
    longer, shorter, heading = axes_of(track)

    def sampled(values: np.ndarray) -> dict[str, Any]:
        return {"epoch": times[0], "number": np.stack([since, values], axis=1).round(6).ravel().tolist()}

    longitude, latitude = (np.asarray(track.earth[name], float) for name in ("longitude", "latitude"))
    # Between two samples Cesium takes the straight way.
    places = np.stack([since, np.unwrap(longitude, period=360), latitude, 0 * since], axis=1).round(7)
    colour = {"solidColor": {"color": {"rgba": [*_ORANGE, 255]}}}
    return {
        "id": f"track {track.label}",
        "name": f"track {track.label}",
        "availability": f"{times[0]}/{times[-1]}",
        "position": {"epoch": times[0], "cartographicDegrees": places.ravel().tolist()},
        "point": {"pixelSize": 8, "color": {"rgba": [*_ORANGE, 255]}},
        "label": {"text": str(track.label), "pixelOffset": {"cartesian2": [12, -12]}},
        "path": {"width": 2, "material": colour},
        "ellipse": {
            "semiMajorAxis": sampled(longer),
            "semiMinorAxis": sampled(shorter),
            "rotation": sampled(-heading),
            "height": 0,
            "material": {"solidColor": {"color": {"rgba": [*_ORANGE, 64]}}},
        },
    }


def _utc(track: Track) -> np.ndarray:
    utc = track.utc
    assert utc is not None, "UTC is known"
    return utc


def _first_and_last(tracks: list[Track]) -> list[Any]:
    first = min(tracks, key=lambda track: track.start_s)
    last = max(tracks, key=lambda track: track.end_s)
    return [(np.min, first), (np.max, last)]


def _put(
    parent: ElementTree.Element, name: str, text: str | None = None, space: str = _KML, **attributes: str
) -> ElementTree.Element:
    """A child of an element."""
    child = ElementTree.SubElement(parent, f"{{{space}}}{name}", attributes)
    child.text = text
    return child
