"""GeoParquet 1.1: the table of states with a point each, in longitude and latitude (OGC:CRS84)."""

import json
import struct
from pathlib import Path
from typing import Any

from faintrack.errors import InputError
from faintrack.results.exports import require_earth
from faintrack.results.result import Result

_GEO = {
    "version": "1.1.0",
    "primary_column": "geometry",
    "columns": {"geometry": {"encoding": "WKB", "geometry_types": ["Point"]}},
}
"""Metadata of the file; without a `crs` places are longitude and latitude."""


def write_geoparquet(path: Path, result: Result) -> None:
    """Write GeoParquet.

    Raises
    ------
    InputError : the result has no place on earth, or pyarrow is not installed.
    """
    require_earth(result, "GeoParquet")
    try:
        import pyarrow as pa
        from pyarrow.parquet import write_table
    except ImportError as error:
        raise InputError(
            'GeoParquet needs pyarrow, which is not installed: pip install "faintrack[parquet]".'
        ) from error
    table = result.to_dataframe()
    moments = {"utc": table["utc"].astype("datetime64[ms, UTC]")} if "utc" in table else {}
    columns = {
        name: pa.array(
            moments.get(name, table[name]), pa.timestamp("ms", "UTC") if name in moments else _type(pa, name)
        )
        for name in table
    }
    # Well-known binary: little endian, a point, x, y.
    points = [struct.pack("<BIdd", 1, 1, x, y) for x, y in zip(table.longitude_deg, table.latitude_deg, strict=True)]
    columns["geometry"] = pa.array(points, pa.binary())
    made = pa.table(columns)
    write_table(made.replace_schema_metadata({"geo": json.dumps(_GEO)}), path)


def _type(pa: Any, name: str) -> Any:
    """Type of a column, which a table without a row does not tell."""
    return pa.int64() if name == "label" else pa.float64()
