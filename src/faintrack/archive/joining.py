"""Tracks joined over the seams between chains, and the tables of states and tracks.

Within a chain labels go on by themselves. A chain that begins with a burn-in has followed the targets for a while when
the one before it ends: two tracks that were near each other in the scans that both chains have, nearer than the sensor
tells apart (`within` of a plan), are one. Of several that are near, those are joined whose distances are least in all.

A track is named after its first scan, ``20260101T003412.500Z``: the name says when, is the same however time was cut,
and stays when files are added.
"""

import json
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from faintrack.archive.cut import stamped
from faintrack.archive.pieces import SECOND
from faintrack.archive.store import Store
from faintrack.archive.tables import read_table, write_table
from faintrack.results.folder import replaced

if TYPE_CHECKING:
    import pandas as pd

JOINED = "joined.json"
"""Names of the tracks of every chain, and of which segments they were made."""

PLACES = {"bearing_deg": 360.0}
"""Columns that tell where a target is, and after how much they begin anew."""


def join(store: Store) -> int:
    """Write the tables of states and tracks of all chains whose segments have changed; returns how many.

    Raises
    ------
    InputError : a table is damaged, or cannot be written.
    """
    by_station: dict[str, dict[int, list[dict[str, Any]]]] = {}
    for segment in store.segments():
        by_station.setdefault(segment["station"], {}).setdefault(segment["chain"], []).append(segment)
    file = store.path / JOINED
    before = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    after: dict[str, Any] = {}
    written = 0
    for station, chains in by_station.items():
        previous: list[dict[str, Any]] | None = None
        for chain, segments in sorted(chains.items()):
            key, last = f"{station}/{stamped(chain)}", None if previous is None else _key(previous)
            made_of = [segment["fingerprint"] for segment in segments]
            names_before = {} if last is None else after[last]["tracks"]
            made_of += [str(sorted(names_before.items()))]
            known = before.get(key)
            if known is not None and known["made_of"] == made_of:
                after[key] = known
            else:
                names = _written(store, segments, previous, names_before)
                after[key] = {"made_of": made_of, "tracks": names}
                written += 1
            previous = segments
    if after != before:
        _remove(store, set(before) - set(after))
        replaced(file, lambda beside: beside.write_text(json.dumps(after) + "\n", encoding="utf-8"))
    return written


def matches(one: "pd.DataFrame", other: "pd.DataFrame", within: float, interval: float) -> dict[int, int]:
    """Tracks of a chain that are tracks of the chain before it.

    Parameters
    ----------
    one, other : states of the chain before and of the chain in the time that both have; columns `utc`, `label` and
        those of places.
    within : largest distance of two that are one; unit of the place.
    interval : between scans; s.

    Returns
    -------
    Label in `one` by label in `other`.

    Examples
    --------
    >>> import pandas as pd
    >>> utc = pd.to_datetime([0, 1, 2] * 2, unit="s", utc=True)
    >>> one = pd.DataFrame({"utc": utc, "label": [4] * 3 + [7] * 3, "bearing_deg": [10, 11, 12, 179, 179, 179]})
    >>> other = pd.DataFrame({"utc": utc, "label": [1] * 3 + [2] * 3, "bearing_deg": [-179, 180, 180, 40, 41, 42]})
    >>> matches(one, other, 5.0, 1.0)
    {1: 7}
    """
    firsts, seconds = sorted(set(one["label"])), sorted(set(other["label"]))
    if not firsts or not seconds:
        return {}
    distance = np.full((len(firsts), len(seconds)), np.inf)
    step = interval * SECOND
    for row, first in enumerate(firsts):
        for column, second in enumerate(seconds):
            mine, theirs = one[one["label"] == first], other[other["label"] == second]
            scans, others = (np.round(_nanoseconds(part) / step).astype(np.int64) for part in (mine, theirs))
            _, at, there = np.intersect1d(scans, others, return_indices=True)
            if at.size:
                apart = 0.0
                for name, turn in PLACES.items():
                    away = mine[name].to_numpy(float)[at] - theirs[name].to_numpy(float)[there]
                    apart = apart + np.abs(np.remainder(away + turn / 2, turn) - turn / 2) ** 2
                distance[row, column] = np.sqrt(np.median(apart))
    near = distance <= within
    # What is too far is farther than all that is near taken together.
    rows, columns = linear_sum_assignment(np.where(near, distance, 1 + within * distance.size))
    return {seconds[j]: firsts[i] for i, j in zip(rows, columns, strict=True) if near[i, j]}


def _written(
    store: Store,
    segments: list[dict[str, Any]],
    previous: list[dict[str, Any]] | None,
    names_before: dict[str, str],
) -> dict[str, str]:
    """Write the tables of a chain; returns the names of its tracks by label."""
    import pandas as pd

    first = segments[0]
    states = _states(store, segments)
    chain = pd.Timestamp(first["chain"], unit="ns", tz="UTC")
    burn_in, own = states[states["utc"] < chain], states[states["utc"] >= chain]
    joined = {}
    if previous is not None and len(burn_in):
        reaching = [segment for segment in previous if segment["stop"] > first["origin"]]
        earlier = _states(store, reaching or previous[-1:])
        joined = matches(earlier[earlier["utc"] >= burn_in["utc"].min()], burn_in, first["within"], first["frame_s"])
    names: dict[str, str] = {}
    for label, rows in own.groupby("label"):
        name = names_before.get(str(joined.get(int(label))))
        if name is None:
            begun = stamped(int(_nanoseconds(rows).min()))
            taken = {*names.values(), *names_before.values()}
            name = next(one for one in (begun, *(f"{begun}-{number}" for number in range(2, 1000))) if one not in taken)
        names[str(label)] = name
    own = own.assign(track=own["label"].astype(str).map(names))
    _write_days(store, first["station"], first["chain"], own[["track", *own.columns.drop("track")]])
    # A track that was joined keeps its name for the chain after this one, also where it is in its burn-in alone.
    return names


def _states(store: Store, segments: Iterable[dict[str, Any]]) -> "pd.DataFrame":
    import pandas as pd

    return pd.concat(
        [read_table(store.path / "segments" / segment["name"] / "states.parquet") for segment in segments],
        ignore_index=True,
    )


def _write_days(store: Store, station: str, chain: int, states: "pd.DataFrame") -> None:
    """States and tracks of a chain by day; a chain of which nothing is left leaves no table."""
    _remove(store, {f"{station}/{stamped(chain)}"})
    for day, rows in states.groupby(states["utc"].dt.strftime("%Y-%m-%d")):
        for name, table in (("states", rows.sort_values(["track", "utc"])), ("tracks", tracks_in(rows))):
            file = _tables(store, name, station) / f"day={day}" / f"{stamped(chain)}.parquet"
            file.parent.mkdir(parents=True, exist_ok=True)
            replaced(file, lambda beside, table=table: write_table(beside, table))  # type: ignore[misc]


def tracks_in(states: "pd.DataFrame") -> "pd.DataFrame":
    """One row a track: first and last scan, how many, largest existence, and every component at both ends."""
    import pandas as pd

    ordered = states.sort_values("utc").groupby("track", sort=True)
    components = [
        name for name in states.columns if name not in ("track", "utc", "label", "existence") and name[-4:] != "_std"
    ]
    columns: dict[str, Any] = {
        "start": ordered["utc"].first(),
        "end": ordered["utc"].last(),
        "label": ordered["label"].first(),
        "scans": ordered.size().astype("int32"),
        "existence_max": ordered["existence"].max(),
    }
    for name in components:
        columns |= {f"{name}_start": ordered[name].first(), f"{name}_end": ordered[name].last()}
    return pd.DataFrame(columns).reset_index(names="track")


def _tables(store: Store, name: str, station: str) -> Path:
    return store.path / name / f"station={station}"


def _remove(store: Store, chains: set[str]) -> None:
    """Remove the tables of chains."""
    for key in chains:
        station, chain = key.rsplit("/", 1)
        for name in ("states", "tracks"):
            for file in _tables(store, name, station).glob(f"day=*/{chain}.parquet"):
                file.unlink()
                if not any(file.parent.iterdir()):
                    shutil.rmtree(file.parent)


def _nanoseconds(states: "pd.DataFrame") -> np.ndarray:
    values: np.ndarray = states["utc"].to_numpy("datetime64[ns]").astype(np.int64)
    return values


def _key(segments: list[dict[str, Any]]) -> str:
    return f"{segments[0]['station']}/{stamped(segments[0]['chain'])}"
