"""Commands for the lines of machinery: the spectrum of a recording, and that of its envelope."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from faintrack.cli.commands import Json

Recordings = Annotated[list[Path], typer.Argument(help="Files of one recording.")]
Resolution = Annotated[
    float | None, typer.Option(metavar="HZ", help="One over the length of a window; chosen from the band if not given.")
]
Interval = Annotated[
    float | None, typer.Option(metavar="SECONDS", help="From row to row; 600 rows at most if not given.")
]
Channels = Annotated[
    list[str] | None, typer.Option("--channel", metavar="NAME", help="Channel to take; several are averaged.")
]
Folder = Annotated[Path | None, typer.Option(help="Folder for picture.png, lines.csv and record.npz.")]


def lofar(
    files: Recordings,
    band: Annotated[tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Frequencies; Hz.")] = None,
    resolution: Resolution = None,
    interval: Interval = None,
    channel: Channels = None,
    out: Folder = None,
    as_json: Json = False,
) -> None:
    """List the lines in the spectrum of a recording, with their harmonics, and draw it over time (LOFAR).

    Example: [bold]faintrack lofar night.wav --band 10 500 --resolution 0.5 --out lofar[/bold]
    """
    from faintrack.signal.lofar import lofar as record_of

    recording, channels = _read(files, channel)
    record = record_of(recording, band, resolution, interval, channels)
    _tell(recording, record, "spectrum over its background", out, as_json)


def demon(
    files: Recordings,
    band: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Noise whose envelope is taken; Hz.")
    ] = None,
    highest: Annotated[float, typer.Option(metavar="HZ", help="Rate up to which lines are looked for.")] = 100.0,
    resolution: Resolution = None,
    interval: Interval = None,
    channel: Channels = None,
    out: Folder = None,
    as_json: Json = False,
) -> None:
    """List the lines in the envelope of a recording's noise, as of shafts and blades, and draw it over time (DEMON).

    Example: [bold]faintrack demon night.wav --band 2000 8000 --highest 60 --out demon[/bold]
    """
    from faintrack.signal.demon import demon as record_of

    recording, channels = _read(files, channel)
    record = record_of(recording, band, highest, resolution, interval, channels)
    _tell(recording, record, "spectrum of the envelope over its background", out, as_json)


def _read(files: list[Path], names: list[str] | None) -> tuple[Any, list[int] | None]:
    """A recording, and the numbers of the channels with some names."""
    from faintrack import read
    from faintrack.errors import InputError

    recording = read(*files, kind="recording")
    for name in names or ():
        if name not in recording.channel_names:
            known = ", ".join(recording.channel_names)
            raise InputError(f"{recording.source}: there is no channel {name!r}; expected one of {known}.")
    return recording, [recording.channel_names.index(name) for name in names] if names else None


def _tell(recording: Any, record: Any, shown: str, out: Path | None, as_json: bool) -> None:
    """Print the lines of a record and what a reader of it must know, and write it."""
    from dataclasses import asdict

    from faintrack.cli.tables import print_lines
    from faintrack.results.lofargrams import save_lofargram

    if out is not None:
        save_lofargram(record, out, f"{recording.source}: {shown}")
    remarks = (*recording.remarks, *record.remarks)
    if as_json:
        lines = [asdict(line) for line in record.lines]
        print(json.dumps({"threshold_db": record.threshold_db, "lines": lines, "remarks": remarks}))
        return
    print_lines(record)
    for remark in remarks:
        print(f"remark     {remark}")
    if out is not None:
        print(f"written    {out}")
