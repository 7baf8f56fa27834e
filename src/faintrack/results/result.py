"""What came out of data of any kind: every scan as named variables with units, and the tracks."""

import html
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from faintrack.results.schema import covered_seconds
from faintrack.results.track import Track, tracks_of
from faintrack.scenario.promise import promise_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Result:
    """What came out.

    Attributes
    ----------
    data : one entry a scan and slot, in the schema of `faintrack.results.schema`.
    scenario : what was run.
    kind : of the data, a `faintrack.kinds.kind.Kind`: it knows the facts and the picture.
    seconds : that the run took.
    remarks : what was assumed or left out; one sentence each.
    misfits : where the data are not as the model has them; one sentence each. Where there is one, the numbers of
        existence are the model's, and not to be taken for certain.
    """

    data: xr.Dataset
    scenario: Any
    kind: Any
    seconds: float
    remarks: tuple[str, ...] = field(default=())
    misfits: tuple[str, ...] = field(default=())

    @cached_property
    def tracks(self) -> list[Track]:
        """What was declared, by label."""
        return tracks_of(self.data)

    def track(self, label: int) -> Track:
        """Track of a label.

        Raises
        ------
        KeyError : there is none.
        """
        for track in self.tracks:
            if track.label == label:
                return track
        raise KeyError(f"there is no track {label}; labels are {[track.label for track in self.tracks]}")

    def plot(self) -> "Figure":
        """Picture of the result, a matplotlib figure that belongs to no window."""
        import matplotlib

        # Names of stations and files are no formulas.
        with matplotlib.rc_context({"text.parse_math": False}):
            figure: Figure = self.kind.draw(self)
        return figure

    def report(self, file: str | Path) -> Path:
        """Write a report that a person can mail, one HTML file; returns its path."""
        from faintrack.results.report import write_report

        return write_report(file, self)

    def save(self, folder: str | Path) -> Path:
        """Write data, tables, scenario and report to a folder, which `faintrack.read_result` reads; returns it."""
        from faintrack.results.folder import save_result

        saved = save_result(self, folder)
        self.report(saved / "report.html")
        return saved

    def export(self, path: str | Path, to: str | None = None) -> Path:
        """Write the tracks for another program, in the format of the path's end or of a name; returns the path.

        Formats: `faintrack.results.exports.FORMATS`.
        """
        from faintrack.results.exports import export

        return export(self, path, to)

    def to_dataframe(self) -> "pd.DataFrame":
        """Estimates of all tracks, one row a track and scan; the columns are those of `states.csv`."""
        import pandas as pd

        from faintrack.results.tables import state_columns, state_rows

        return pd.DataFrame(state_rows(self.data), columns=state_columns(self.data))

    def summary(self) -> dict[str, Any]:
        """Tracks and speed as plain values, for programs.

        `scans` is their number, `scan_interval` the time between them in seconds, `seconds` what the run took,
        `realtime_factor` the length of the data over it. Kinds count further: `masked_scans`, in which a channel was
        left out; `full_scans`, in which a target was found and no slot was free. `false_tracks` is what was promised
        and is expected of them (`faintrack.scenario.promise.Promise`), or None. Where there are `misfits`, existence is
        the model's, and not certain.
        """
        scans, interval = self.data.sizes["time"], float(self.data.attrs["scan_interval"])
        counts = {
            str(values.attrs["counted"]): int((values > 0).sum())
            for values in self.data.data_vars.values()
            if "counted" in values.attrs
        }
        promise = promise_of(self.scenario, self.kind.gained(self.scenario), covered_seconds(self.data))
        return {
            "kind": self.kind.name,
            "tracks": [track.summary() for track in self.tracks],
            "scans": scans,
            "scan_interval": interval,
            "seconds": self.seconds,
            "realtime_factor": scans * interval / self.seconds,
            "false_tracks": None if promise is None else promise.as_dict(),
            **counts,
            "remarks": list(self.remarks),
            "misfits": list(self.misfits),
        }

    def _repr_html_(self) -> str:
        """Tracks in a table, as a notebook shows them."""
        from faintrack.results.report import track_table

        name = html.escape(str(self.data.attrs["source"]))
        return f"<h4>{html.escape(self.kind.title)}: {name}</h4>{track_table(self)}"
