"""Tracks: the estimates of one label over time, as a person reads them."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.results.schema import column, places, rates, units

DEGREES = ("latitude", "longitude")
"""Where a target is on earth, in results that know."""


@dataclass(frozen=True, eq=False)
class Track:
    """One target from its declaration to its end.

    Attributes
    ----------
    label : running number from 1.
    time : of its scans; seconds from time 0 of the result.
    existence : probability that the track's target exists.
    mean : of each component of the state, by name.
    covariance : of the components, in the order of `mean`.
    units : of the components.
    place : components that tell where the target is.
    rates : name of the rate of each component that has one.
    earth : latitude and longitude, degrees, by name; empty where they are not known.
    start_time : what time 0 is in UTC; None where it is not known.
    """

    label: int
    time: Float[np.ndarray, " scan"]
    existence: Float[np.ndarray, " scan"]
    mean: dict[str, Float[np.ndarray, " scan"]]
    covariance: Float[np.ndarray, "scan component component"]
    units: dict[str, str]
    place: tuple[str, ...]
    rates: dict[str, str]
    earth: dict[str, Float[np.ndarray, " scan"]]
    start_time: np.datetime64 | None

    @property
    def start_s(self) -> float:
        """Time of the first scan; seconds from the first scan of all."""
        return float(self.time[0])

    @property
    def end_s(self) -> float:
        """Time of the last scan; seconds from the first scan of all."""
        return float(self.time[-1])

    @property
    def existence_max(self) -> float:
        """Largest probability that the track's target exists."""
        return float(self.existence.max())

    @property
    def std(self) -> dict[str, Float[np.ndarray, " scan"]]:
        """Standard deviation of each component, by name."""
        roots = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        return {name: roots[:, number] for number, name in enumerate(self.mean)}

    @property
    def utc(self) -> np.ndarray | None:
        """Times in UTC; None where they are not known."""
        if self.start_time is None:
            return None
        return self.start_time + np.round(np.asarray(self.time, float) * 1e9).astype("timedelta64[ns]")

    @property
    def speed(self) -> float:
        """Way from the first place to the last over the time between them; unit of the place a second."""
        ways = [
            math.remainder(last - first, 360) if self.units[name] == "degree" else last - first
            for name in self.place
            for first, last in [(float(self.mean[name][0]), float(self.mean[name][-1]))]
        ]
        lasted = self.end_s - self.start_s
        return math.hypot(*ways) / lasted if lasted > 0 else 0.0

    @property
    def with_rates(self) -> list[str]:
        """Components, each place followed by its rate, as (x, vx, y, vy), then the others."""
        names = list(self.mean)
        order = [name for place in self.place for name in (place, self.rates.get(place)) if name in names]
        return order + [name for name in names if name not in order]

    def average(self, name: str) -> float:
        """Mean of a component over the track, each scan weighted by its certainty; angles on the circle."""
        certainty = 1 / np.maximum(self.std[name], 1e-6) ** 2
        # Where the tracker knows no deviation, all scans count alike.
        certainty = np.where(np.isfinite(certainty), certainty, 1.0)
        values = self.mean[name]
        if self.units[name] != "degree":
            return float(np.average(values, weights=certainty))
        sum_of_directions = np.sum(certainty * np.exp(1j * np.radians(values)))
        return float(np.degrees(np.angle(sum_of_directions)))

    def summary(self) -> dict[str, Any]:
        """Row of a table of tracks: label, start and end, each component's mean and deviation, places at both ends.

        Names carry units: `bearing_deg` is the mean over the track, `bearing_deg_std` the root mean square of its
        deviation, `bearing_deg_start` and `bearing_deg_end` the values in the first and the last scan.
        """
        row: dict[str, Any] = {"label": self.label, "start_s": self.start_s, "end_s": self.end_s}
        std = self.std
        for name, values in self.mean.items():
            title = column(name, self.units[name])
            row[title] = self.average(name)
            row[f"{title}_std"] = float(np.sqrt(np.mean(std[name] ** 2)))
            if name in self.place:
                row[f"{title}_start"], row[f"{title}_end"] = float(values[0]), float(values[-1])
        for name, values in self.earth.items():
            row[f"{name}_deg_start"], row[f"{name}_deg_end"] = float(values[0]), float(values[-1])
        row[column("speed", f"{self.units[self.place[0]]}/s")] = self.speed
        row["existence_max"] = self.existence_max
        return row


def tracks_of(data: xr.Dataset) -> list[Track]:
    """Tracks in the data of a result, by label.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from types import SimpleNamespace
    >>> from faintrack.results.schema import Component, estimated
    >>> from faintrack.targets.states import RangeState
    >>> say = SimpleNamespace(existence=np.full(4, 0.9), label=np.array([0, 1, 1, 0]), track_existence=np.full(4, 0.9),
    ...     mean=RangeState(3 * jnp.arange(4.0), jnp.ones(4)), covariance=np.tile(np.eye(2), (4, 1, 1)))
    >>> components = (Component("range", "m", place=True, rate="range_rate"), Component("range_rate", "m/s"))
    >>> track, = tracks_of(estimated(2 * np.arange(4.0), say, components))
    >>> track.start_s, track.end_s, track.summary()["range_m_end"], track.speed
    (2.0, 4.0, 6.0, 1.5)
    """
    label = data.label.values
    time = np.asarray(data.time.values, float)
    names = [str(name) for name in data.component.values]
    existence, covariance = data.track_existence.values, data.covariance.values
    means = {name: data[name].values for name in names}
    earth = {name: data[name].values for name in DEGREES if name in data}
    start = data.attrs.get("start_time") or None
    facts: dict[str, Any] = {
        "units": units(data),
        "place": tuple(places(data)),
        "rates": rates(data),
        "start_time": None if start is None else np.datetime64(start.removesuffix("Z"), "ns"),
    }
    tracks = []
    for number in np.unique(label[label > 0]):
        scans, slots = np.nonzero(label == number)
        tracks.append(
            Track(
                int(number),
                time[scans],
                existence[scans, slots],
                {name: values[scans, slots] for name, values in means.items()},
                covariance[scans, slots],
                earth={name: values[scans, slots] for name, values in earth.items()},
                **facts,
            )
        )
    return tracks
