"""How sweeps become a result: spokes averaged to rows, tracker, and what is kept for the picture."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.errors import InputError, naming
from faintrack.kinds.kind import Plan
from faintrack.kinds.sweeps.build import averaged_spokes, build_tracker, chosen
from faintrack.kinds.sweeps.data import Look, Sweeps
from faintrack.kinds.sweeps.echoes import Rows
from faintrack.kinds.sweeps.sections import SweepsScenario
from faintrack.kinds.sweeps.tracker import Sweep, SweepEstimate, SweepsTracker, Watching
from faintrack.results.schema import estimated, of_scans, planar

BLOCK_BYTES = 16 * 2**20
"""Of the sweeps held at once; sweeps a block follow from it."""

PICTURE = (1024, 512)
"""Rows and samples of the picture that is kept, at most; of more the largest are."""

State = tuple[Watching, Array]


class SweepsStep(eqx.Module):
    """Sweeps through the tracker.

    Attributes
    ----------
    tracker : that takes them in.
    """

    tracker: SweepsTracker

    def scans(self, block: Sweep) -> Sweep:
        """Sweeps of a block."""
        return block

    def advance(self, state: State, scan: Sweep, key: PRNGKeyArray) -> tuple[State, SweepEstimate]:
        """Windows and slots, and the sum of all sweeps; the estimate. Nothing is drawn."""
        watching, total = state
        watching, estimate = self.tracker.step(watching, scan)
        values = scan.values
        step = tuple(-(-size // most) for size, most in zip(values.shape, PICTURE, strict=True))
        padded = jnp.pad(values, [(0, -size % part) for size, part in zip(values.shape, step, strict=True)])
        shape = (padded.shape[0] // step[0], step[0], padded.shape[1] // step[1], step[1])
        return (watching, total + padded.reshape(shape).max(axis=(1, 3))), estimate


def plan(sweeps: Sweeps, scenario: SweepsScenario) -> Plan:
    """How sweeps become a result.

    Raises
    ------
    InputError : sweeps and scenario do not fit together, or a sweep cannot be read.
    """
    with naming(sweeps.source):
        scenario = chosen(scenario, sweeps)
        tracker = build_tracker(scenario, sweeps)
    spokes, samples = sweeps.shape
    average = averaged_spokes(scenario, spokes)
    scale = float(scenario.echo.full_scale or 1.0) * scenario.echo.deviation
    middle, first = sweeps.middle, sweeps.look(0, 1)
    origin = float(first.x[0, 0]), float(first.y[0, 0])

    def read(start: int, stop: int) -> Sweep:
        stop = min(stop, sweeps.length)
        values = checked(sweeps.read(start, stop), start, sweeps)
        look = sweeps.look(start, stop)
        received = np.isfinite(look.time)
        rows = _rows(look, received, average, origin, middle[0], sweeps)
        shared = received.reshape(len(values), -1, average)
        kept = np.where(received[..., None], values, 0).reshape(len(values), -1, average, samples)
        summed = kept.sum(axis=2, dtype=np.float32)
        means = summed / (scale * np.maximum(shared.sum(axis=2), 1))[..., None].astype(np.float32)
        return Sweep(rows, means, middle[start:stop] - middle[0])

    def rows(start: int, block: Sweep, outputs: SweepEstimate) -> xr.Dataset:
        count = len(block.time)
        data = estimated(middle[start : start + count] - middle[0], outputs, planar())
        data["x"], data["y"] = data.x + np.float32(origin[0]), data.y + np.float32(origin[1])
        for name, component in (("x", "x"), ("y", "y")):
            data[name].attrs = {"units": "m", "long_name": f"mean {component}"}
        look = sweeps.look(start, start + count)
        data["antenna_x"] = of_scans(look.x[:, spokes // 2], "m", "place of the antenna, east")
        data["antenna_y"] = of_scans(look.y[:, spokes // 2], "m", "place of the antenna, north")
        heading = np.degrees(look.heading[:, spokes // 2])
        data["antenna_heading"] = of_scans(heading, "degree", "that spoke 0 looks to, clockwise from north")
        data["windows"] = of_scans(outputs.windows, "1", "windows on echoes")
        data["unwatched"] = of_scans(
            outputs.unwatched, "1", "an echo lay in no window, and none was free", counted="unwatched_scans"
        )
        return data.assign_attrs(_attributes(sweeps))

    def close(state: State) -> xr.Dataset:
        return _picture(np.asarray(state[1]) / sweeps.length, sweeps)

    size = 4 * spokes // average * samples
    rows_kept, samples_kept = (
        -(-count // -(-count // most)) for count, most in zip((spokes // average, samples), PICTURE, strict=True)
    )
    reach = (samples - 1) * sweeps.spacing
    return Plan(
        scenario=scenario,
        step=SweepsStep(tracker),
        state=(tracker.init(), jnp.zeros((rows_kept, samples_kept), jnp.float32)),
        read=read,
        rows=rows,
        length=sweeps.length,
        size=int(np.clip(BLOCK_BYTES // size, 1, 32)),
        seed=0,
        within=4 * scenario.echo.along * sweeps.spacing,
        limits=None if sweeps.x is not None else {name: (-reach, reach) for name in ("x", "y")},
        close=close,
    )


def checked(values: Any, number: int, sweeps: Sweeps) -> np.ndarray:
    """Sweeps, the first of which has this number; refuses what nothing can be told from.

    Raises
    ------
    InputError : a sweep has another shape than the first, or holds values that are no numbers or below 0.
    """
    values = np.asarray(values)
    if values.shape[1:] != sweeps.shape:
        raise InputError(f"{sweeps.source}: sweep {number} has shape {values.shape[1:]}; expected {sweeps.shape}.")
    if values.dtype.kind == "f":
        good = np.isfinite(values).all(axis=(1, 2))
        if not good.all():
            wrong = number + int(np.argmin(good))
            raise InputError(f"{sweeps.source}: sweep {wrong} holds NaN or infinity; expected finite values.")
    if values.dtype.kind in "fi" and values.size and values.min() < 0:
        wrong = number + int(np.argmax(values.min(axis=(1, 2)) < 0))
        raise InputError(f"{sweeps.source}: sweep {wrong} holds values below 0; expected intensities.")
    return values


def _rows(
    look: Look, received: np.ndarray, average: int, origin: tuple[float, float], start: float, sweeps: Sweeps
) -> Rows:
    """When and whence rows of averaged spokes looked; a row without a time of its own has that of its neighbours."""
    count, spokes = received.shape

    def mean(values: Float[np.ndarray, "sweep spoke"]) -> Any:
        return values.reshape(count, -1, average).mean(axis=2)

    pace = sweeps.interval / spokes
    since = look.time - start
    for known, times in zip(received, since, strict=True):
        numbers = np.flatnonzero(known)
        gaps = np.flatnonzero(~known)
        nearest = numbers[np.clip(np.searchsorted(numbers, gaps), 0, len(numbers) - 1)]
        times[gaps] = times[nearest] + pace * (gaps - nearest)
    known_rows: Any = received.reshape(count, -1, average).any(axis=2)
    turned = np.unwrap(look.heading, axis=1)
    return Rows(
        mean(since),
        mean(look.x - origin[0]).astype(np.float32),
        mean(look.y - origin[1]).astype(np.float32),
        np.mod(mean(turned).astype(np.float32), np.float32(2 * np.pi)),
        known_rows,
    )


def _attributes(sweeps: Sweeps) -> dict[str, Any]:
    first = float(sweeps.middle[0])
    start = ""
    if sweeps.start_time is not None:
        start = f"{sweeps.start_time + np.timedelta64(round(first * 1e9), 'ns')}Z"
    return {
        "kind": "sweeps",
        "source": sweeps.source,
        "start_time": start,
        "first_scan_time": first,
        "scan_interval": sweeps.interval,
    }


def _picture(mean: Float[np.ndarray, "row sample"], sweeps: Sweeps) -> xr.Dataset:
    """Mean of all sweeps, as they lie around the antenna."""
    spokes, samples = sweeps.shape
    azimuth = (np.arange(len(mean)) + 0.5) / len(mean) * 360 - 180 / spokes
    step = samples / mean.shape[1]
    distance = ((np.arange(mean.shape[1]) + 0.5) * step - 0.5) * sweeps.spacing
    return xr.Dataset(
        {
            "record": (
                ("axis_azimuth", "axis_range"),
                mean.astype(np.float16),
                {"units": "1", "long_name": "mean of all sweeps"},
            )
        },
        {
            "axis_azimuth": ("axis_azimuth", azimuth, {"units": "degree", "long_name": "clockwise from the heading"}),
            "axis_range": ("axis_range", distance, {"units": "m", "long_name": "range"}),
        },
    )
