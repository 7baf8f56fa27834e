"""Tables of an archive as Parquet, through pyarrow: files, states, tracks.

Times are `timestamp[ns, UTC]`; columns have their units in their names as in `states.csv`. The same rows give the same
bytes.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from faintrack.archive.pieces import Piece
from faintrack.errors import InputError
from faintrack.results.tables import state_columns, state_rows

if TYPE_CHECKING:
    import pandas as pd


def parquet() -> Any:
    """Module of pyarrow that reads and writes Parquet.

    Raises
    ------
    InputError : pyarrow is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise InputError(
            "an archive's tables are Parquet, which needs pyarrow: pip install 'faintrack[parquet]'."
        ) from error
    return pyarrow.parquet


def write_table(file: Path, table: "pd.DataFrame") -> None:
    """Write a table."""
    import pyarrow

    # Pandas' own description of its columns names versions, and would change the bytes with them.
    content = pyarrow.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(None)
    parquet().write_table(content, file, compression="zstd")


def read_table(file: Path, columns: list[str] | None = None) -> "pd.DataFrame":
    """Read a table, or some of its columns.

    Raises
    ------
    InputError : it is damaged.
    """
    module = parquet()
    try:
        # `read_table` would add columns for folders such as station=north.
        table: pd.DataFrame = module.ParquetFile(file).read(columns).to_pandas()
    # pyarrow has errors of several classes for damaged files.
    except Exception as error:
        raise InputError(f"{file} is damaged ({' '.join(str(error).split())[:200]}).") from error
    return table


def states_of(data: xr.Dataset) -> "pd.DataFrame":
    """States of the tracks in the data of a result that knows when it starts, one row a track and scan."""
    import pandas as pd

    columns = state_columns(data)
    table = pd.DataFrame(list(state_rows(data)), columns=columns)
    numbers = [name for name in columns if name not in ("time_s", "utc", "label", "existence")]
    kinds: dict[str, Any] = {name: "float32" for name in numbers} | {"label": "int32", "existence": "float64"}
    table = table.astype(kinds)
    start = np.datetime64(data.attrs["start_time"].removesuffix("Z"), "ns")
    since = np.round(table["time_s"].to_numpy(float) * 1e9).astype("timedelta64[ns]")
    table["utc"] = pd.DatetimeIndex(start + since).tz_localize("UTC")
    return table.drop(columns="time_s")


def write_files(file: Path, pieces: Iterable[Piece]) -> None:
    """Write the files of an archive, one row a piece."""
    import pyarrow

    listed = list(pieces)
    of = {
        "station": [piece.station for piece in listed],
        "start": pyarrow.array([piece.begin for piece in listed], pyarrow.timestamp("ns", "UTC")),
        "samples": [piece.length for piece in listed],
        "sample_rate_hz": [piece.sample_rate for piece in listed],
        "channels": pyarrow.array([piece.channel_names for piece in listed], pyarrow.list_(pyarrow.string())),
        "paths": pyarrow.array([piece.paths for piece in listed], pyarrow.list_(pyarrow.string())),
        "stamps": pyarrow.array([piece.stamps for piece in listed], pyarrow.list_(pyarrow.string())),
    }
    parquet().write_table(pyarrow.table(of), file, compression="zstd")


def read_files(file: Path) -> list[Piece]:
    """Files of an archive as `write_files` wrote them.

    Raises
    ------
    InputError : the table is damaged.
    """
    table = read_table(file)
    starts = table["start"].to_numpy("datetime64[ns]").astype(np.int64)
    return [
        Piece(
            *(tuple(row.paths), tuple(row.stamps), row.station, int(start), 0, int(row.samples)),
            *(float(row.sample_rate_hz), tuple(row.channels)),
        )
        for row, start in zip(table.itertuples(), starts, strict=True)
    ]
