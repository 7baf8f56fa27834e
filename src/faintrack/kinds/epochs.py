"""Times that stay exact over weeks: compiled code has them from an epoch that moves along.

Single precision resolves a tenth of a millisecond within 17 minutes and no second in 200 days. On the host times are
in double precision, in blocks and in results. What is compiled has the time since the **epoch** of its scan, the last
whole multiple of `SPAN` before it, and whatever a state remembers of time is moved to the new epoch when a scan has
another one than the last. A multiple of a power of two is subtracted without rounding where it brings a time nearer to
zero; only what lies far back, and no longer matters to a second, is rounded. The epoch belongs to the scan, so that
blocks of any size give the same bits.

A field that holds a time has one of the names in `TIMES`, in blocks and in states; this is how it is known.
"""

from typing import Any

import jax
import numpy as np
from jax.tree_util import GetAttrKey
from jaxtyping import Array, Float

SPAN = 1024.0
"""Seconds from epoch to epoch."""

TIMES = frozenset({"time", "born", "declared", "laid", "since"})
"""Names of fields that hold times; seconds."""


def epochs(block: Any, before: float) -> Float[np.ndarray, " scan"]:
    """Epochs of the scans of a block; seconds.

    Parameters
    ----------
    block : arrays with one entry a scan along their first axis; the first field that holds times tells them.
    before : epoch of the scan before the block, and of blocks that hold no time.

    Examples
    --------
    >>> from collections import namedtuple
    >>> epochs(namedtuple("Block", "time")(np.array([3.0, 1023.5, 1024.0, 1e8])), 0.0).tolist()
    [0.0, 0.0, 1024.0, 99999744.0]
    """
    held = [leaf for path, leaf in jax.tree_util.tree_leaves_with_path(block) if _is_time(path)]
    if not held:
        return np.full(len(jax.tree.leaves(block)[0]), before)
    times = np.asarray(held[0], np.float64)
    return np.floor(times.reshape(len(times), -1).min(axis=1) / SPAN) * SPAN


def since_epochs(block: Any, epochs: Float[np.ndarray, " scan"], state: Any) -> Any:
    """A block whose times are from the epochs of its scans, in the precision of the state that takes them in.

    Examples
    --------
    >>> from collections import namedtuple
    >>> block = namedtuple("Block", "time")(np.array([3.0, 1e8 + 0.25]))
    >>> since_epochs(block, np.array([0.0, 99999744.0]), None).time.tolist()
    [3.0, 256.25]
    """
    remembered = [leaf for path, leaf in jax.tree_util.tree_leaves_with_path(state) if _is_time(path)]
    precision = remembered[0].dtype if remembered else np.float32

    def moved(path: Any, values: Any) -> Any:
        if not _is_time(path):
            return values
        times = np.asarray(values, np.float64)
        return (times - epochs.reshape(-1, *(1,) * (times.ndim - 1))).astype(precision)

    return jax.tree_util.tree_map_with_path(moved, block)


def moved_on(state: Any, seconds: Float[Array, ""]) -> Any:
    """A state whose times are from an epoch that is so much later.

    Examples
    --------
    >>> from collections import namedtuple
    >>> of = namedtuple("State", "time x")(jax.numpy.array(1000.0), jax.numpy.array(5.0))
    >>> after = moved_on(of, jax.numpy.array(1024.0))
    >>> float(after.time), float(after.x)
    (-24.0, 5.0)
    """

    def moved(path: Any, values: Any) -> Any:
        return values - seconds.astype(values.dtype) if _is_time(path) else values

    return jax.tree_util.tree_map_with_path(moved, state)


def _is_time(path: tuple[Any, ...]) -> bool:
    return bool(path) and isinstance(path[-1], GetAttrKey) and path[-1].name in TIMES
