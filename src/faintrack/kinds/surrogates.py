"""Data without a target, made of data with some: what each sensor reported stays, and what belongs together is parted.

A target shows in what sensors have in common, or in what follows from scan to scan. Taken apart, the same samples,
frames and returns hold none, and their statistics one by one are exactly those of the data. What a surrogate cannot
keep is what the noise itself has in common:

- channels shifted apart lose the noise that neighbours share (isotropic noise, hum), which is what an array of close
  channels is most often wrong about;
- frames, returns and sets in another order lose slow changes: drifting clouds, swell, a fading sea;
- what stays at one place all the time is in every order at that place, and is taken for background.

Where these matter, a stretch that is known to be quiet says more (`faintrack.kinds.stretches`).
"""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Int

from faintrack.data.bearings import Bearings
from faintrack.data.contacts import Contacts
from faintrack.data.recording import Recording
from faintrack.data.returns import Returns
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError

Measured = TypeVar("Measured", Returns, Contacts)
"""What was measured in pings."""


def shifted_apart(recording: Recording, apart: float, seed: int) -> Recording:
    """Recording whose channels are shifted in time, circularly, each by another amount.

    Any two shifts differ by `apart` or more, and at random beyond it: shifts that are evenly spaced would leave a tone
    a plane wave. A block is read with the longest shift beyond it, so memory does not grow with the length.

    Parameters
    ----------
    recording : any.
    apart : that two channels are shifted apart at least, more than a wave needs from one to the other; seconds.
    seed : of the shifts.

    Raises
    ------
    InputError : the recording is too short to shift its channels so far apart.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> samples = np.arange(100.0)[:, None] * [1, 1]
    >>> shifted = shifted_apart(from_samples(samples, 10.0), 1.0, seed=0).read(0, 100)
    >>> sorted(shifted[:, 0]) == sorted(samples[:, 0]), bool(abs(shifted[0, 0] - shifted[0, 1]) >= 10)
    (True, True)
    """
    length, count = recording.length, recording.channels
    step = max(1, int(np.ceil(apart * recording.sample_rate)))
    longest = 2 * step * count
    if longest > length:
        raise InputError(
            f"{recording.source} lasts {recording.duration:.4g} s; expected at least "
            f"{longest / recording.sample_rate:.4g} s, to shift {count} channels {apart:.3g} s apart; give a stretch "
            "that is quiet (--quiet START:END)."
        )
    rng = np.random.default_rng(seed)
    shifts = 2 * step * rng.permutation(count) + rng.integers(0, step + 1, count)

    def read(start: int, stop: int) -> np.ndarray:
        span = min(stop - start + longest, length)
        samples = _around(recording, start, start + span)
        return np.take_along_axis(samples, (np.arange(stop - start)[:, None] + shifts) % span, axis=0)

    return replace(recording, read=read, source=f"{recording.source}, channels shifted apart")


def _around(recording: Recording, start: int, stop: int) -> np.ndarray:
    """Samples from `start`, beginning again after the last one."""
    length = recording.length
    if stop <= length:
        return np.asarray(recording.read(start, stop))
    return np.concatenate([recording.read(start, length), recording.read(0, stop - length)])


def reordered(sequence: Sequence, seed: int) -> Sequence:
    """Sequence whose frames are in another order, at the same times; every cell keeps its values.

    Examples
    --------
    >>> from faintrack.data.sequence import from_frames
    >>> frames = np.arange(5.0)[:, None] * np.ones(3)
    >>> other = reordered(from_frames(frames), seed=0).read(0, 5)
    >>> sorted(other[:, 0].tolist()), bool((other[:, 0] == other[:, 2]).all())
    ([0.0, 1.0, 2.0, 3.0, 4.0], True)
    """
    order = order_of(sequence.length, seed)

    def read(start: int, stop: int) -> np.ndarray:
        return np.concatenate([sequence.read(number, number + 1) for number in order[start:stop].tolist()])

    return replace(sequence, read=read, source=f"{sequence.source}, frames in another order")


def order_of(length: int, seed: int) -> Int[np.ndarray, " scan"]:
    """Numbers of scans in random order."""
    return np.random.default_rng(seed).permutation(length)


def exchanged(returns: Measured, seed: int) -> Measured:
    """Returns or contacts that arrived in other pings, all of a ping together; pings and platforms stay as they are.

    Examples
    --------
    >>> from faintrack.data.returns import from_columns
    >>> columns = {"time_s": [0, 0, 9], "delay_s": [4, 5, 6], "bearing_deg": [0, 0, 0], "snr_db": [9, 9, 9]}
    >>> returns = from_columns(columns)
    >>> sorted(exchanged(returns, seed=0).counts.tolist()), sorted(exchanged(returns, seed=0).delay.tolist())
    ([1, 2], [4.0, 5.0, 6.0])
    """
    if returns.pair is None or returns.reported is None:
        ping, order = _redistributed(returns.ping, order_of(returns.length, seed))
    else:
        moved = _among_reported(returns.ping, returns.pair, returns.reported, seed)
        order = np.argsort(moved, kind="stable")
        ping = moved[order]
    return returns.taken(order, ping=ping, origin=f"{returns.origin}, pings exchanged")


def _among_reported(
    scan: Int[np.ndarray, " report"],
    group: Int[np.ndarray, " report"],
    reported: Bool[np.ndarray, "scan group"],
    seed: int,
) -> Int[np.ndarray, " report"]:
    """New scans of reports, those of each group among the scans in which it reported."""
    rng = np.random.default_rng(seed)
    scan = scan.copy()
    for number in range(reported.shape[1]):
        there = np.flatnonzero(reported[:, number])
        place = np.arange(len(reported))
        place[there] = rng.permutation(there)
        mine = group == number
        scan[mine] = place[scan[mine]]
    return scan


def _redistributed(
    scan: Int[np.ndarray, " report"], place: Int[np.ndarray, " scan"]
) -> tuple[Int[np.ndarray, " report"], Int[np.ndarray, " report"]]:
    """New scans of reports, ascending, and the order in which the reports then stand."""
    moved = place[scan]
    order = np.argsort(moved, kind="stable")
    return moved[order], order


def mixed(bearings: Bearings, seed: int) -> Bearings:
    """Bearings whose sets were reported in other scans: of every observer among those in which it reported.

    Examples
    --------
    >>> from faintrack.data.bearings import from_columns
    >>> heard = from_columns({"time_s": [0, 0, 9], "bearing_deg": [1, 2, 3], "observer_x_m": [0, 0, 0],
    ...                       "observer_y_m": [0, 0, 0]})
    >>> sorted(np.bincount(mixed(heard, seed=0).scan).tolist())
    [1, 2]
    """
    scan = _among_reported(bearings.scan, bearings.observer, bearings.heard, seed)
    order = np.argsort(scan, kind="stable")
    return replace(
        bearings,
        scan=scan[order],
        observer=bearings.observer[order],
        bearing=bearings.bearing[order],
        rows=bearings.rows[order],
        origin=f"{bearings.origin}, sets in another order",
    )
