"""Coast lines around a place, for maps: Natural Earth, land at 1:10 million (public domain), to 0.0001 degree.

Source: naturalearthdata.com by way of the package world-atlas 2.0.2 (`coast.LICENSE`). Good for orientation; a line may
be a kilometre off.
"""

from importlib.resources import files

import numpy as np
from jaxtyping import Float

_UNIT = 1e-4
"""Degrees of a step in the file."""


def coast_lines(longitude: tuple[float, float], latitude: tuple[float, float]) -> list[Float[np.ndarray, "point 2"]]:
    """Pieces of coast in a box, each with one point beyond it, so that lines reach its edge.

    Parameters
    ----------
    longitude, latitude : from and to; degrees. A box across 180 degrees reaches beyond it, as (179, 182).

    Returns
    -------
    Longitude and latitude of the points of each piece; degrees, on the same turn as the box.

    Examples
    --------
    >>> lines = coast_lines((-1.7, -1.0), (50.5, 50.8))          # the Isle of Wight
    >>> len(lines) > 0, all(abs(line[:, 1] - 50.65).min() < 0.2 for line in lines)
    (True, True)
    >>> coast_lines((-31.0, -30.0), (40.0, 41.0))                # the Atlantic
    []
    """
    with (files("faintrack.results") / "coast.npz").open("rb") as file, np.load(file) as stored:
        start, count, step = (stored[name] for name in ("start", "count", "step"))
    lines = []
    first = np.concatenate([[0], np.cumsum(count - 1)])
    for number in range(len(count)):
        steps = step[first[number] : first[number + 1]].astype(int)
        line = _UNIT * np.concatenate([start[number][None], start[number] + np.cumsum(steps, axis=0)])
        turns = 360 * np.round((np.mean(longitude) - line[0, 0]) / 360)
        line[:, 0] += turns
        inside = np.all((line >= (longitude[0], latitude[0])) & (line <= (longitude[1], latitude[1])), axis=1)
        if not inside.any():
            continue
        kept = inside | np.append(inside[1:], False) | np.insert(inside[:-1], 0, False)
        runs = np.split(np.flatnonzero(kept), np.flatnonzero(np.diff(np.flatnonzero(kept)) > 1) + 1)
        lines += [line[run] for run in runs if len(run) > 1]
    return lines
