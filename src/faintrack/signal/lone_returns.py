r"""Loud returns without neighbours: contacts that were told as returns.

An echo of power s raises the bins beside its own, by what the response h of the sonar has there, to
:math:`\mu = 1 + (s - 1) h`, and each exceeds the threshold :math:`\gamma` with the probability
:math:`e^{-\gamma / \mu}`. Of loud returns most then have a neighbour, along delay, bearing or Doppler. Where a detector
has joined the bins of each echo there is none, and the likelihood of bins takes the silence around a return for
evidence against a target.
"""

from typing import NamedTuple

import numpy as np

from faintrack.signal.pings import Binned

LOUD = 10.0
"""Times the threshold from which on a return is loud."""

SURE = 0.5
"""Probability of a neighbour from which on a return tells anything."""


class Neighbours(NamedTuple):
    """Loud returns that should have neighbours.

    Attributes
    ----------
    returns : how many there are.
    expected : of these, that have a neighbour.
    found : that do.
    """

    returns: int
    expected: float
    found: int


def neighbours(binned: Binned, threshold: float) -> Neighbours:
    """How many loud returns have a neighbour (the module's text).

    Parameters
    ----------
    binned : returns in their bins.
    threshold : that they exceed, over the mean power of the noise; linear.
    """
    shape, power = binned.sonar.shape, binned.returns.power[binned.order]
    ping = binned.returns.ping[binned.order]
    whole = (binned.returns.length, *shape)
    held = np.ravel_multi_index((ping, *binned.bins.T), whole)
    quiet, found = np.ones(len(power)), np.zeros(len(power), bool)
    for axis in range(3):
        for step in (-1, 1):
            if shape[axis] == 1:
                continue
            offset = [np.array(float(step)) if number == axis else np.array(0.0) for number in range(3)]
            mean = 1 + (power - 1) * float(binned.sonar.tabled(*offset))
            bins = binned.bins.copy()
            bins[:, axis] += step
            if axis == 1:
                bins[:, axis] %= shape[axis]
            there = (bins[:, axis] >= 0) & (bins[:, axis] < shape[axis])
            quiet = np.where(there, quiet * -np.expm1(-threshold / mean), quiet)
            beside = np.ravel_multi_index((ping, *np.where(there[:, None], bins, 0).T), whole)
            found |= there & np.isin(beside, held)
    counted = (power >= LOUD * threshold) & (1 - quiet >= SURE)
    return Neighbours(int(counted.sum()), float((1 - quiet)[counted].sum()), int((found & counted).sum()))
