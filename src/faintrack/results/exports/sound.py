"""Tracks beside the sound: labels of Audacity and selection tables of Raven, both texts with tabs.

A track lasts from the start of its first frame to the end of its last one, in seconds of the recording. The frequencies
are the band that was analysed; without a band none are written, and both programs then take all.
"""

from collections.abc import Iterator
from pathlib import Path

from faintrack.errors import InputError
from faintrack.results.result import Result
from faintrack.results.schema import column
from faintrack.results.track import Track


def write_audacity(path: Path, result: Result) -> None:
    """Write labels of Audacity: start, end, text, and a second line with the frequencies.

    Raises
    ------
    InputError : the result is of no recording.
    """
    band = _band(result, "Audacity")
    lines = []
    for track, start, end in _spans(result):
        place = track.place[0]
        said = f"track {track.label}, {place} {track.average(place):.1f} {track.units[place]}"
        lines.append(f"{start:.6f}\t{end:.6f}\t{said}")
        if band is not None:
            lines.append(f"\\\t{band[0]:.6f}\t{band[1]:.6f}")
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def write_raven(path: Path, result: Result) -> None:
    """Write a selection table of Raven, with a column for the place at both ends.

    Raises
    ------
    InputError : the result is of no recording.
    """
    band = _band(result, "Raven")
    place = [str(name) for name in result.data.component.values[result.data.place.values]]
    titles = [
        f"{column(name, str(unit))}_{end}"
        for name, unit in zip(place, result.data.unit.values[result.data.place.values], strict=True)
        for end in ("start", "end")
    ]
    heads = ["Selection", "View", "Channel", "Begin Time (s)", "End Time (s)"]
    heads += [] if band is None else ["Low Freq (Hz)", "High Freq (Hz)"]
    lines = ["\t".join([*heads, "Existence", *titles, "Annotation"])]
    for number, (track, start, end) in enumerate(_spans(result), start=1):
        row = track.summary()
        cells = [str(number), "Spectrogram 1", "1", f"{start:.6f}", f"{end:.6f}"]
        cells += [] if band is None else [f"{edge:.3f}" for edge in band]
        cells += [f"{track.existence_max:.6f}", *(f"{row[title]:.4f}" for title in titles), f"track {track.label}"]
        lines.append("\t".join(cells))
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def _spans(result: Result) -> Iterator[tuple[Track, float, float]]:
    """Each track with its ends in the recording; the time of a frame is its middle."""
    half = float(result.data.attrs["scan_interval"]) / 2
    for track in result.tracks:
        yield track, max(track.start_s - half, 0.0), track.end_s + half


def _band(result: Result, title: str) -> tuple[float, float] | None:
    """Frequencies that were analysed; refuses what was no sound."""
    analysis = getattr(result.scenario, "analysis", None)
    if analysis is None:
        raise InputError(f"the result of {result.data.attrs['source']} is of no recording; {title} needs sound.")
    return None if analysis.band is None else (float(analysis.band[0]), float(analysis.band[1]))
