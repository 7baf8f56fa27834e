"""Set-ups of several arrays in which too little evidence arrives: told before a run, and in the report."""

import math

import numpy as np

from faintrack.trackers.several import SeveralTargetsTracker

SLOWER = 2.0
"""Times as long as its evidence alone takes that a target is found in: cells are looked at in a few points, and it
moves from one to the next."""


def about_evidence(tracker: SeveralTargetsTracker, interval: float) -> tuple[str, ...]:
    r"""Whether a target leaves a detector before it is found there; a sentence, or none.

    A detector of c cells hands a target over at the odds of `detect`. Before, they are those of arrival over departure,
    spread over its cells, so that it takes :math:`\log c + \log(departure / arrival) + logit(detect)` nats.

    Parameters
    ----------
    tracker : of a region, or of one array by itself.
    interval : between scans; seconds.
    """
    filter = tracker.detectors.filter
    target, axes = filter.target, dict(filter.grid.axes)
    if "vx" not in axes or not target.arrival_rate or not target.departure_rate:
        return ()
    arrays = np.asarray(tracker.trackers.likelihood.mean_log_ratio(), float)
    needed = math.log(math.prod(axis.count for axis in axes.values()))
    needed += math.log(target.departure_rate / target.arrival_rate) + math.log(tracker.detect / (1 - tracker.detect))
    takes = SLOWER * max(needed / arrays.sum(), 1.0) * interval
    stays = min(axes[name].step * axes[name].count / axes[f"v{name}"].edges[-1] for name in "xy")
    stays = min(stays, 1 / target.departure_rate)
    if takes <= stays / 2:
        return ()
    return (
        f"A target adds {arrays.sum():.2g} nats of evidence a scan, all {len(arrays)} arrays together, and takes "
        f"{takes:.3g} s or so to be found, while the fastest stay in a detector for {stays:.3g} s; expected at most "
        "half. Louder targets, more arrays, larger or fewer detectors or a lower speed would do.",
    )
