"""Records of LOFAR and DEMON as a person looks at them: a picture, a table of lines, files."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from matplotlib.figure import Figure

from faintrack.errors import InputError
from faintrack.io.checks import explained
from faintrack.io.write_recordings import completed
from faintrack.results.pictures import GREY, LINE, TRACK
from faintrack.signal.lofar import Line, Lofargram

HEADINGS = ("frequency (Hz)", "level (dB)", "fundamental (Hz)", "harmonic")
COLUMNS = ("frequency_hz", "level_db", "fundamental_hz", "harmonic")

RANGE_DB = -3.0, 12.0
"""Of the colours, which lines rise out of."""

NAMED = 12
"""Lines that a picture names at most, the loudest."""


def line_rows(lines: Sequence[Line]) -> list[tuple[str, str, str, str]]:
    """Lines as rows of a table.

    Examples
    --------
    >>> line_rows([Line(7.3, 11.25, 3.65, 2), Line(50.0, 20.0)])
    [('7.300', '11.2', '3.650', '2'), ('50.000', '20.0', '', '')]
    """
    return [
        (
            f"{line.frequency:.3f}",
            f"{line.level_db:.1f}",
            "" if line.fundamental is None else f"{line.fundamental:.3f}",
            str(line.harmonic) if line.harmonic else "",
        )
        for line in lines
    ]


def draw_lofargram(record: Lofargram, title: str = "", figure: Figure | None = None) -> Figure:
    """Figure of a record: levels over frequency and time, and their mean with its lines.

    Parameters
    ----------
    record : to draw.
    title : above it.
    figure : to draw in; where not given, a new one that belongs to no window.
    """
    figure = Figure(figsize=(11, 8), layout="constrained") if figure is None else figure
    waterfall, spectrum = figure.subplots(2, 1, sharex=True, height_ratios=[2.2, 1])
    step = float(record.frequency[1] - record.frequency[0]) if len(record.frequency) > 1 else 1.0
    times = record.times
    half = float(times[1] - times[0]) / 2 if len(times) > 1 else 0.5
    image = waterfall.imshow(
        record.level_db,
        origin="lower",
        aspect="auto",
        extent=(
            float(record.frequency[0]) - step / 2,
            float(record.frequency[-1]) + step / 2,
            float(times[0]) - half,
            float(times[-1]) + half,
        ),
        cmap="cividis",
        vmin=RANGE_DB[0],
        vmax=RANGE_DB[1],
        interpolation="nearest",
    )
    figure.colorbar(image, ax=waterfall, label="level over the background (dB)", pad=0.01)
    waterfall.set_ylabel("time (s)")
    waterfall.set_title(title, fontsize=10)
    spectrum.plot(record.frequency, record.mean_db, color=LINE, linewidth=0.8)
    spectrum.axhline(record.threshold_db, color=GREY, linestyle="--", linewidth=0.8)
    for line in record.lines:
        spectrum.plot(line.frequency, line.level_db, "v", color=TRACK, markersize=5)
    for line in sorted(record.lines, key=lambda line: -line.level_db)[:NAMED]:
        number = f" ({line.harmonic})" if line.harmonic else ""
        spectrum.annotate(
            f"{line.frequency:.4g}{number}",
            (line.frequency, line.level_db),
            xytext=(2, 5),
            textcoords="offset points",
            fontsize=7,
        )
    spectrum.set_xlabel("frequency (Hz); dashed: what noise alone passes once in a hundred records")
    spectrum.set_ylabel("mean level (dB)")
    spectrum.grid(alpha=0.3)
    return figure


def save_lofargram(record: Lofargram, folder: Path, title: str = "") -> None:
    """Write a record to a folder: `picture.png`, `lines.csv`, and `record.npz` with times, frequencies and levels.

    Parameters
    ----------
    record : to write.
    folder : made where it does not exist; earlier files of these names are replaced.
    title : of the picture.

    Raises
    ------
    InputError : the folder cannot be made, or a file not be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made ({error.strerror}).") from error
    rows = [
        f"{line.frequency:.9g},{line.level_db:.6g},"
        + (f"{line.fundamental:.9g},{line.harmonic}" if line.fundamental is not None else ",")
        for line in record.lines
    ]
    text = "\n".join([",".join(COLUMNS), *rows]) + "\n"
    held: dict[str, Any] = {"time": record.times, "frequency": record.frequency, "level_db": record.level_db}
    writers: dict[str, Callable[[BinaryIO], Any]] = {
        "picture.png": lambda file: draw_lofargram(record, title).savefig(file, format="png", dpi=120),
        "lines.csv": lambda file: file.write(text.encode()),
        "record.npz": lambda file: np.savez_compressed(file, **held),
    }
    for name, write in writers.items():
        path = folder / name
        complaint = f"{path} cannot be written"
        with completed(path, complaint) as partial, explained(complaint), partial.open("wb") as file:
            write(file)
