r"""Detection readers of Stone Soup over bearings and over the returns of an active sonar.

Each detection carries the measurement model of a target with the state (x, vx, y, vy) in metres and m/s, which is that
of Stone Soup's constant velocity in the plane. A scan without detections yields an empty set.

A delay is no measurement of Stone Soup's; with the bearing it is a range from the receiver
(`faintrack.sensors.bistatic`). With :math:`J` the derivatives of bearing and range with respect to bearing and delay,
their errors have the covariance

.. math:: J \,\mathrm{diag}(\sigma_\phi^2, \sigma_\tau^2)\, J^\top ,
    \qquad J = \begin{bmatrix} 1 & 0 \\ \partial R / \partial \phi & \partial R / \partial \tau \end{bmatrix} .
"""

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from stonesoup.base import Property
from stonesoup.buffered_generator import BufferedGenerator
from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing, CartesianToBearingRange
from stonesoup.reader.base import DetectionReader
from stonesoup.types.angle import Bearing
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection

from faintrack.data.returns import Returns
from faintrack.errors import InputError
from faintrack.io.bearings import read_bearings
from faintrack.io.returns import read_returns
from faintrack.sensors.bistatic import Bistatic
from faintrack.stonesoup.clock import date
from faintrack.targets.states import PlanarState

PLANE: dict[str, Any] = {"ndim_state": 4, "mapping": (0, 2)}
"""Where x and y stand in a state (x, vx, y, vy)."""


class BearingsReader(DetectionReader):
    """Sets of bearings as detections; `metadata["observer"]` is the number of who reported.

    Attributes
    ----------
    bearings : a file, see `faintrack.io.bearings`, or `Bearings` in memory.
    error_deg : standard deviation of the target's bearing; degrees.

    Examples
    --------
    >>> import faintrack as ft
    >>> bearings = ft.from_bearings(
    ...     {"time_s": [0.0], "bearing_deg": [0.0], "observer_x_m": [10.0], "observer_y_m": [0.0]})
    >>> (time, (detection,)), = BearingsReader(bearings, error_deg=1.0)
    >>> round(float(np.degrees(float(detection.state_vector[0]))), 6)     # Stone Soup's are from +x, anticlockwise
    90.0
    """

    bearings: Any = Property(doc="Path, or Bearings in memory")
    error_deg: float = Property(doc="Standard deviation of a target's bearing, degrees")

    @BufferedGenerator.generator_method
    def detections_gen(self) -> Iterator[tuple[datetime, set[Detection]]]:
        """Yield the time and the detections of every scan."""
        given = self.bearings
        data = read_bearings(given) if isinstance(given, str | Path) else given
        error = np.diag([np.radians(self.error_deg) ** 2])
        ends = np.searchsorted(data.scan, np.arange(data.length + 1))
        for scan, time in enumerate(map(date, data.times.tolist())):
            found = set()
            for number in range(ends[scan], ends[scan + 1]):
                observer = data.observer[number]
                place = StateVector(data.place[scan, observer])
                model = Cartesian2DToBearing(**PLANE, noise_covar=error, translation_offset=place)
                known = {"observer": int(data.observers[observer])}
                vector = StateVector([Bearing(data.bearing[number])])
                found.add(Detection(vector, timestamp=time, measurement_model=model, metadata=known))
            yield time, found


class ReturnsReader(DetectionReader):
    """Returns of one source and one receiver as detections in bearing and range; `metadata["snr_db"]` is their level.

    Doppler shifts are left out.

    Attributes
    ----------
    returns : a file, see `faintrack.io.returns`, or `Returns` in memory.
    error_deg : standard deviation of a target's bearing; degrees.
    delay_error : standard deviation of its delay; s.
    source, receiver : where they stand still, east and north; m. The columns of the returns take their place.
    sound_speed : m/s.

    Raises
    ------
    InputError : there are several sources or receivers, or it is not known where they are; when detections are read.

    Examples
    --------
    >>> import faintrack as ft
    >>> echo = ft.from_returns({"time_s": [0.0], "delay_s": [4.0], "bearing_deg": [90.0], "snr_db": [12.0]})
    >>> place = {"source": (0.0, 0.0), "receiver": (0.0, 0.0)}
    >>> (time, (detection,)), = ReturnsReader(echo, error_deg=1.0, delay_error=0.1, **place)
    >>> round(float(detection.state_vector[1]))          # half of the way of 4 s
    3000
    """

    returns: Any = Property(doc="Path, or Returns in memory")
    error_deg: float = Property(doc="Standard deviation of a target's bearing, degrees")
    delay_error: float = Property(doc="Standard deviation of a target's delay, seconds")
    source: Any = Property(default=None, doc="Place of the source where it stands still, (x, y), metres")
    receiver: Any = Property(default=None, doc="Place of the receiver where it stands still, (x, y), metres")
    sound_speed: float = Property(default=1500.0, doc="Metres per second")

    @BufferedGenerator.generator_method
    def detections_gen(self) -> Iterator[tuple[datetime, set[Detection]]]:
        """Yield the time and the detections of every ping."""
        given = self.returns
        data = read_returns(given) if isinstance(given, str | Path) else given
        if len(data.pairs) > 1:
            raise InputError(f"{data.origin} holds {len(data.pairs)} pairs of a source and a receiver; expected one.")
        source, receiver = (self._placed(data, name) for name in ("source", "receiver"))
        ranges, covariances = _ranged(data, source, receiver, self)
        snr_db = 10 * np.log10(data.power)
        ends = np.cumsum([0, *data.counts])
        for ping, time in enumerate(map(date, data.times.tolist())):
            found = set()
            for number in range(ends[ping], ends[ping + 1]):
                model = CartesianToBearingRange(
                    **PLANE, noise_covar=covariances[number], translation_offset=StateVector(receiver[ping])
                )
                vector = StateVector([Bearing(data.bearing[number]), ranges[number]])
                known = {"snr_db": float(snr_db[number])}
                found.add(Detection(vector, timestamp=time, measurement_model=model, metadata=known))
            yield time, found

    def _placed(self, data: Returns, name: str) -> Float[np.ndarray, "ping 2"]:
        """Where a platform is in every ping."""
        moving, still = getattr(data, name), getattr(self, name)
        if moving is not None:
            return moving.reshape(data.length, 4)[:, :2]
        if still is None:
            raise InputError(f"{data.origin} does not tell where the {name} is; expected {name}=(x, y) in metres.")
        return np.tile(np.asarray(still, float), (data.length, 1))


def _ranged(
    data: Returns, source: Float[np.ndarray, "ping 2"], receiver: Float[np.ndarray, "ping 2"], known: ReturnsReader
) -> tuple[Float[np.ndarray, " return"], Float[np.ndarray, "return 2 2"]]:
    """Range of every return from the receiver, m, and covariance of its bearing and range (the module's equation)."""

    def distance(bearing: Any, delay: Any, source: Any, receiver: Any) -> Any:
        still = jnp.zeros(())
        first, second = (PlanarState(end[0], end[1], still, still) for end in (source, receiver))
        return Bistatic(first, second, known.sound_speed).distance(delay, bearing)

    arguments = data.bearing, data.delay, source[data.ping], receiver[data.ping]
    ranges, slopes = jax.vmap(jax.value_and_grad(distance, (0, 1)))(*map(jnp.asarray, arguments))
    by_bearing, by_delay = (np.asarray(slope, float) for slope in slopes)
    ones = np.ones_like(by_bearing)
    jacobian = np.stack([np.stack([ones, 0 * ones], -1), np.stack([by_bearing, by_delay], -1)], -2)
    variances = np.radians(known.error_deg) ** 2, known.delay_error**2
    return np.asarray(ranges, float), jacobian * np.array(variances) @ jacobian.swapaxes(1, 2)
