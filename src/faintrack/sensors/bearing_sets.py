"""Sets of bearings: what a detector reports of a scan, the target's perhaps among them, the others false.

Bearings are in radians anticlockwise from +x, positions in metres. A target is reported at most once in a scan. False
bearings come evenly over the sector that the sensor watches, their number Poisson. They are given by their expected
number in a scan of the whole sector, `false_per_scan`, so that no density can be taken for one of another unit.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from faintrack.errors import InputError
from faintrack.targets.states import PlanarState

Scalar = Float[Array, ""] | float


class BearingSensor(eqx.Module):
    """What a detector of bearings reports.

    Attributes
    ----------
    error : standard deviation of the target's bearing; radians.
    detection_probability : that a target in the sector is reported in a scan.
    false_per_scan : expected number of false bearings in a scan of the sector.
    start, width : of the sector, which goes anticlockwise; radians.

    Raises
    ------
    InputError : an error or a number of false bearings that is not above 0, a probability outside 0 to 1, a width that
        is not above 0 or more than a turn.
    """

    error: Scalar
    detection_probability: Scalar
    false_per_scan: Scalar
    start: float = eqx.field(static=True, default=-math.pi)
    width: float = eqx.field(static=True, default=2 * math.pi)

    def __check_init__(self) -> None:
        if not 0 < self.width <= 2 * math.pi:
            raise InputError(f"bearing sensor: width of the sector is {self.width:g} rad; expected above 0 to a turn.")
        for name, low, high in (
            ("error", 0.0, math.inf),
            ("false_per_scan", 0.0, math.inf),
            ("detection_probability", 0.0, 1.0),
        ):
            value = getattr(self, name)
            # What is traced has no value yet.
            if not isinstance(value, jax.core.Tracer) and not (low < value <= high and value < math.inf):
                bounds = "above 0" if high == math.inf else f"above {low:g}, at most {high:g}"
                raise InputError(f"bearing sensor: {name} is {value:g}; expected {bounds}.")

    @property
    def false_per_radian(self) -> Scalar:
        """Expected number of false bearings in a scan and a radian of the sector."""
        return self.false_per_scan / self.width

    def after_start(self, bearing: Float[Array, "..."]) -> Float[Array, "..."]:
        """How far bearings lie from the start of the sector, anticlockwise; 0 to a turn."""
        turns = (bearing - self.start) / (2 * math.pi)
        return 2 * math.pi * (turns - jnp.floor(turns))


class BearingSet(eqx.Module):
    """Bearings of one scan, or of a stack of scans.

    Attributes
    ----------
    time : seconds.
    bearing : of every entry; radians.
    there : whether an entry is a bearing; those that are not come last.
    observer : where the sensor is; components have the shape of `time`.
    crowding : density of bearings of false detections and of other targets at each entry, over that of the false ones;
        1 where None.
    """

    time: Float[Array, "*scan"]
    bearing: Float[Array, "*scan entry"]
    there: Bool[Array, "*scan entry"]
    observer: PlanarState
    crowding: Float[Array, "*scan entry"] | None = None


def bearing_set(
    sensor: BearingSensor, time: float, bearings: np.ndarray, observer: PlanarState, capacity: int
) -> BearingSet:
    """Scan with given bearings.

    Parameters
    ----------
    sensor : that reports them.
    time : seconds.
    bearings : radians, in any order.
    observer : where the sensor is; scalars.
    capacity : entries; at least as many as there are bearings.

    Raises
    ------
    InputError : more bearings than the capacity, a bearing that is not a number or outside the sector.

    Examples
    --------
    >>> sensor = BearingSensor(0.02, 0.9, 5.0)
    >>> here = PlanarState(*(jnp.zeros(()) for _ in range(4)))
    >>> bearing_set(sensor, 1.0, np.array([0.5, -2.0]), here, capacity=4).there.tolist()
    [True, True, False, False]
    """
    bearings = np.asarray(bearings, float).ravel()
    if len(bearings) > capacity:
        raise InputError(f"scan at {time:g} s: {len(bearings)} bearings; expected at most the capacity, {capacity}.")
    wrong = np.flatnonzero(~(np.asarray(sensor.after_start(jnp.asarray(bearings))) <= sensor.width))
    if len(wrong):
        raise InputError(
            f"scan at {time:g} s, bearing {wrong[0]}: {bearings[wrong[0]]:g} rad; expected one of the sector from "
            f"{sensor.start:g} rad over {sensor.width:g} rad."
        )
    missing = capacity - len(bearings)
    return BearingSet(
        jnp.asarray(time, float),
        jnp.asarray(np.pad(bearings, (0, missing)), float),
        jnp.arange(capacity) < len(bearings),
        observer,
    )
