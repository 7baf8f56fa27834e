"""Tracks beside the targets of a run: which are whose, how far off, and what comes of a close pass.

A track is held to be that of a target as long as it is within `CUTOFF` of it; one that is not, in most of its scans, of
any target is false. GOSPA has the same cutoff and order 2; it, errors and triangulation are taken over the scans from
`SETTLED` on. In a close pass a target is **lost** where a track of the two has ended by the last scan, the two are
**merged** where both tracks are then nearer to the same target, and **swapped** where each is nearer to the target that
was the other's before.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import xarray as xr

from faintrack.metrics.sets import SetDistance, gospa
from faintrack.studies.kreucher2011 import scene
from faintrack.studies.kreucher2011.triangulation import crossing

CUTOFF = 50.0
"""Farthest that a track is held to be that of a target; m."""

SETTLED = 40
"""Scan from which tracks are compared with targets."""


@dataclass(frozen=True)
class Tracks:
    """Tracks and targets of one run.

    Attributes
    ----------
    label : shape (scan, slot); 0 where there is no track.
    place : shape (scan, slot, 2); m.
    true : shape (scan, target, 2); m.
    """

    label: np.ndarray
    place: np.ndarray
    true: np.ndarray

    @property
    def apart(self) -> np.ndarray:
        """Distance of every track from every target, shape (scan, slot, target); infinite where there is no track."""
        apart = np.linalg.norm(self.place[:, :, None] - self.true[:, None], axis=-1)
        return np.where(self.label[:, :, None] > 0, apart, np.inf)

    def first(self) -> np.ndarray:
        """Scan, counted from 1, in which each target has a track for the first time; infinite where never."""
        near = (self.apart < CUTOFF).any(axis=1)
        return np.where(near.any(axis=0), 1.0 + near.argmax(axis=0), np.inf)

    def false(self) -> int:
        """Tracks that are those of no target."""
        nearest = self.apart.min(axis=2, initial=np.inf)
        labels = np.unique(self.label[self.label > 0])
        return int(sum(np.median(nearest[self.label == label]) >= CUTOFF for label in labels))

    def distances(self) -> list[tuple[float, float, int]]:
        """GOSPA, sum of squared errors and number of pairs of every scan from `SETTLED` on."""
        last = zip(self.label[SETTLED - 1 :], self.place[SETTLED - 1 :], self.true[SETTLED - 1 :], strict=True)
        scans = [gospa(place[label > 0], true, CUTOFF) for label, place, true in last]
        return [(scan.total, scan.localisation, int((scan.pairs >= 0).all(axis=1).sum())) for scan in scans]

    def at_the_end(self) -> SetDistance:
        """Tracks and targets of the last scan."""
        return gospa(self.place[-1][self.label[-1] > 0], self.true[-1], CUTOFF)


def tracks_of(data: xr.Dataset) -> list[Tracks]:
    """Runs of a setting; without the targets that are not there."""
    label = data.label if "label" in data else data.active * (1 + np.arange(data.sizes["slot"]))
    place = np.stack([data.x.values, data.y.values], axis=-1)
    true = np.stack([data.true_x.values, data.true_y.values], axis=-1)
    present = np.isfinite(true[0, 0, :, 0])
    return [Tracks(*run) for run in zip(label.values, place, true[:, :, present], strict=True)]


def handed_over(data: xr.Dataset) -> np.ndarray:
    """Scan in which the last track that is there at `SETTLED` was handed over, for every run."""
    label, existence = (data[name].values[:, :SETTLED] for name in ("label", "existence"))
    # The last scan without a target in the slot is that of the hand-over.
    free = SETTLED - np.argmax(existence[:, ::-1] == 0, axis=1)
    return np.where(label[:, -1] > 0, free, 0).max(axis=1)


def before_and_after(tracks: Sequence[Tracks], before: int) -> dict[str, np.ndarray]:
    """What came of the two tracks of the targets that meet, for every run that has both at scan `before`."""
    outcome: dict[str, list[bool]] = {"lost": [], "merged": [], "swapped": []}
    for run in tracks:
        close = list(scene.CLOSE) if run.true.shape[1] > len(scene.CLOSE) else [0, 1]
        apart = run.apart[before - 1][:, close]
        slots = apart.argmin(axis=0)
        if slots[0] == slots[1] or apart.min(axis=0).max() >= CUTOFF:
            continue
        labels = run.label[before - 1][slots]
        last = [np.flatnonzero(run.label[-1] == label) for label in labels]
        alive = all(len(slot) for slot in last)
        nearest = run.apart[-1][[slot[0] for slot in last]][:, close].argmin(axis=1) if alive else np.array([0, 1])
        outcome["lost"].append(not alive)
        outcome["merged"].append(alive and nearest[0] == nearest[1])
        outcome["swapped"].append(alive and nearest.tolist() == [1, 0])
    return {name: np.array(values, bool) for name, values in outcome.items()}


def ghosts_stay(true: np.ndarray) -> bool:
    """Whether both places where the beams of one target cross those of another might be targets up to `SETTLED`.

    Parameters
    ----------
    true : shape (scan, target, 2); m. The first two are looked at.

    Examples
    --------
    >>> scan = np.arange(80.0)[:, None, None]
    >>> ghosts_stay(np.array([[300.0, 800.0], [400.0, 800.0]]) + 0 * scan)
    True
    >>> ghosts_stay(np.array([[100.0, 400.0], [1300.0, 400.0]]) + 0 * scan)
    False
    """
    stations = scene.stations()
    east, north = np.moveaxis(true[:SETTLED, None, :2] - np.stack([stations.x, stations.y], axis=-1)[:, None], -1, 0)
    bearings = np.arctan2(north, east)
    bearings[:, 1] = bearings[:, 1, ::-1]
    ghosts = np.asarray(crossing(stations, jnp.asarray(bearings)))
    low, high = np.transpose(scene.REGION)
    inside = (ghosts > low) & (ghosts < high)
    return bool(inside.all() and (np.abs(np.diff(ghosts, axis=0)) < scene.SPEED.edges[-1]).all())
