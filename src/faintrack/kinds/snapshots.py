"""Scans of which more is kept than a few numbers, for pictures."""

import numpy as np
from jaxtyping import Int

SNAPSHOTS = 8
"""Scans of which more is kept, at most."""


def snapshots_of(length: int) -> Int[np.ndarray, " snapshot"]:
    """Numbers of the scans of which more is kept: `SNAPSHOTS` at most, evenly spaced, the last one among them.

    Examples
    --------
    >>> snapshots_of(20).tolist(), snapshots_of(3).tolist()
    ([1, 4, 6, 9, 11, 14, 16, 19], [0, 1, 2])
    """
    count = min(SNAPSHOTS, length)
    return (np.arange(1, count + 1) * length) // max(count, 1) - 1


def slots_of(numbers: Int[np.ndarray, " scan"], snapshots: Int[np.ndarray, " snapshot"]) -> Int[np.ndarray, " scan"]:
    """Place of every scan among those of which more is kept; their number where it is none of them."""
    return np.where(np.isin(numbers, snapshots), np.searchsorted(snapshots, numbers), len(snapshots))
