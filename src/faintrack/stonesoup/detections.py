"""From detections of Stone Soup to bearings that faintrack tracks."""

from collections.abc import Iterable
from dataclasses import replace
from datetime import datetime

import numpy as np
from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing, CartesianToBearingRange
from stonesoup.types.detection import Detection

from faintrack.data.bearings import Bearings, from_columns
from faintrack.errors import InputError
from faintrack.stonesoup.clock import seconds

Row = tuple[float, float, float, float, float]
Scans = Iterable[tuple[datetime, Iterable[Detection]]]


def bearings_of(*observers: Scans) -> Bearings:
    """Bearings from detections of Stone Soup; times are seconds since the start of 1970.

    Parameters
    ----------
    observers : the scans of each: a detection reader, feeder or simulator of Stone Soup, or a list of times and sets of
        detections. Measurement models are `Cartesian2DToBearing` or `CartesianToBearingRange`, of which the bearing is
        taken; their offset is where the observer is, their rotation where it points.

    Raises
    ------
    InputError : there is no detection at all, one has no such model, or one observer is in two places in a scan.

    Notes
    -----
    A scan without detections speaks against a target and does not say where the observer was: it is taken to be on a
    straight line between the places before and after, and a remark says so.

    Examples
    --------
    >>> from stonesoup.types.state import State
    >>> east = Cartesian2DToBearing(
    ...     ndim_state=4, mapping=(0, 2), noise_covar=np.eye(1), translation_offset=np.array([[100.0], [0.0]]))
    >>> target = State([[100.0], [0.0], [50.0], [0.0]])
    >>> heard = Detection(east.function(target), timestamp=datetime(2000, 1, 1), measurement_model=east)
    >>> bearings = bearings_of([(datetime(2000, 1, 1), {heard}), (datetime(2000, 1, 1, 0, 0, 1), set())])
    >>> np.degrees(bearings.bearing).round(6).tolist(), np.diff(bearings.times).tolist(), bearings.place[1, 0].tolist()
    ([90.0], [1.0], [100.0, 0.0])
    """
    rows: list[Row] = []
    remarks: list[str] = []
    for number, scans in enumerate(observers):
        reported, silent = _reported(scans, number)
        if not reported:
            raise InputError(f"observer {number} of Stone Soup has no detection; expected one, which says where it is.")
        known = np.array(sorted({(time, x, y) for time, _, x, y, _ in reported}))
        x, y = (np.interp(silent, known[:, 0], known[:, axis]) for axis in (1, 2))
        rows += reported + [(time, np.nan, *place, number) for time, *place in zip(silent, x, y, strict=True)]
        if silent:
            remarks.append(
                f"In {len(silent)} scans without a detection observer {number} is taken to be on a straight line "
                "between its places before and after."
            )
    if not rows:
        raise InputError("there are no detections of Stone Soup; expected those of one observer or several.")
    table = np.array(sorted(rows, key=lambda row: (row[0], row[4]))).T
    names = ("time_s", "bearing_deg", "observer_x_m", "observer_y_m", "observer")
    columns = dict(zip(names, table, strict=True))
    return replace(from_columns(columns, origin="detections of Stone Soup"), remarks=tuple(remarks))


def _reported(scans: Scans, observer: int) -> tuple[list[Row], list[float]]:
    """Rows of the detections of one observer, and the times at which it had none."""
    rows: list[Row] = []
    silent: list[float] = []
    for when, detections in scans:
        time, before = seconds(when), len(rows)
        for detection in detections:
            model = detection.measurement_model
            if not isinstance(model, Cartesian2DToBearing | CartesianToBearingRange):
                raise InputError(
                    f"a detection at {when} has the measurement model {type(model).__name__}; expected "
                    "Cartesian2DToBearing or CartesianToBearingRange."
                )
            bearing = float(detection.state_vector[0, 0])
            ahead = np.array([np.cos(bearing), np.sin(bearing), 0.0])
            east, north, _ = np.linalg.inv(model.rotation_matrix) @ ahead
            x, y = (float(place) for place in np.ravel(model.translation_offset)[:2])
            rows.append((time, float(np.degrees(np.arctan2(east, north))) % 360, x, y, observer))
        if len(rows) == before:
            silent.append(time)
    return rows, silent
