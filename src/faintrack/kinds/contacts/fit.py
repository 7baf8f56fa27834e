r"""Whether contacts that are no target's look like false ones of the model: what results tell of it.

Under the model they are as many as is said, even over all that is reported, and of n in a ping

.. math:: \frac{n (n - 1)}{2} \prod_k \frac{2 a \sigma_k}{b_k - a_k}

pairs are less than a standard deviations apart in every component. Bins of echoes that were not clustered come together
far more often. A contact counts by the probability that it is no target's.
"""

import math

import numpy as np
from jaxtyping import Float

from faintrack.likelihoods.contact_sets import APART
from faintrack.sensors.contact_sets import BEARING, ContactSensor
from faintrack.sensors.several_sets import SeveralSets

TENTHS = 10
"""Parts of each component in which false contacts are counted."""

OFF, CROWDED = 0.25, 2.0
"""Of the number of false contacts, how far from what is said is told; times as many in a tenth as in the mean."""

DEVIATIONS = 5.0
"""Standard deviations that chance is allowed."""

TOGETHER = 0.1
"""Pairs near each other over all contacts from which on they are told."""


class Fit:
    """Contacts of all pings that are no target's, added up as they come.

    Parameters
    ----------
    sensor : what is said of them.
    learnt : whether their number is the mean of the data.
    """

    def __init__(self, sensor: ContactSensor, learnt: bool) -> None:
        self._sensor, self._learnt = sensor, learnt
        self._scans, self._contacts, self._false = 0, 0, 0.0
        self._near, self._chance = 0.0, 0.0
        self._tenths = np.zeros((len(sensor.ends), TENTHS))

    def add(self, scans: SeveralSets, association: Float[np.ndarray, "ping pair entry"]) -> None:
        """Add some pings.

        Parameters
        ----------
        scans : as the likelihood reads them.
        association : probability of every contact that it is a target's.
        """
        there = np.asarray(scans.sets.there) & np.asarray(scans.heard)[..., None]
        false = np.where(there, 1 - np.clip(association, 0, 1), 0.0)
        values = np.asarray(scans.sets.values, float)
        self._scans += int(np.sum(scans.heard))
        self._contacts += int(there.sum())
        self._false += float(false.sum())
        near = there[..., :, None] & there[..., None, :] & ~np.eye(there.shape[-1], dtype=bool)
        for number, (error, (low, high)) in enumerate(zip(self._sensor.errors, self._sensor.ends, strict=True)):
            part = values[..., number]
            apart = part[..., :, None] - part[..., None, :]
            after = part - low
            if number == BEARING:
                apart, after = (apart + math.pi) % (2 * math.pi) - math.pi, after % (2 * math.pi)
            near &= np.abs(apart) <= APART * float(error)
            tenth = np.clip((TENTHS * after / (high - low)).astype(int), 0, TENTHS - 1)
            self._tenths[number] += np.bincount(tenth.ravel(), false.ravel(), TENTHS)
        count = there.sum(axis=-1)
        self._near += near.sum() / 2
        self._chance += float(chance_of_neighbours(self._sensor) * (count * (count - 1) / 2).sum())

    def remarks(self) -> tuple[str, ...]:
        """What was learnt; one sentence."""
        if not self._learnt:
            return ()
        return (
            f"The number of false contacts, {float(self._sensor.false_per_ping):.3g} a ping, is the mean of the data, "
            f"targets among them; {self._false / max(self._scans, 1):.3g} were no target's (contacts.false_per_ping).",
        )

    def misfits(self) -> tuple[str, ...]:
        """Why existence may be wrong; one sentence each."""
        return (*self._of_number(), *self._of_neighbours(), *self._of_places())

    def _of_number(self) -> tuple[str, ...]:
        expected = float(self._sensor.false_per_ping) * self._scans
        off = abs(self._false - expected)
        if self._learnt or off <= max(OFF * expected, DEVIATIONS * math.sqrt(expected)):
            return ()
        found, said = self._false / self._scans, float(self._sensor.false_per_ping)
        return (
            f"There are {found:.3g} contacts a ping that are no target's, and contacts.false_per_ping is {said:.3g}: "
            "existence may be wrong; expected that number, or none, to have it learnt.",
        )

    def _of_neighbours(self) -> tuple[str, ...]:
        enough = max(CROWDED * self._chance, self._chance + DEVIATIONS * math.sqrt(self._chance + 1))
        if self._near <= max(enough, TOGETHER * self._contacts):
            return ()
        return (
            f"Contacts of a ping are near each other {self._near:.0f} times, {self._chance:.2g} expected by "
            "chance: they look like several bins of one echo; expected one contact an echo, or a scenario with [sonar] "
            "that reads all bins.",
        )

    def _of_places(self) -> tuple[str, ...]:
        said: list[str] = []
        names = ("range (m)" if self._sensor.ranged else "delay (s)", "bearing", "Doppler shift (Hz)")
        for number, tenths in enumerate(self._tenths):
            mean, most = tenths.mean(), int(np.argmax(tenths))
            if tenths[most] <= max(CROWDED * mean, mean + DEVIATIONS * math.sqrt(mean + 1)):
                continue
            low, high = self._sensor.ends[number]
            first, last = (low + (high - low) * each / TENTHS for each in (most, most + 1))
            if number == BEARING:
                first, last = ((90 - math.degrees(each)) % 360 for each in (last, first))
            said.append(
                f"Of the contacts that are no target's {100 * tenths[most] / tenths.sum():.3g} % have a "
                f"{names[number]} of {first:.4g} to {last:.4g}, a tenth of all that is reported: existence may be "
                "wrong there; expected false contacts that are as likely everywhere."
            )
        return tuple(said)


def chance_of_neighbours(sensor: ContactSensor) -> float:
    """Probability that two false contacts are near each other (the module's equation).

    Examples
    --------
    >>> sensor = ContactSensor((10.0, 0.01), 0.9, 5.0, ((0.0, 8000.0), (-math.pi, math.pi)), ranged=True)
    >>> round(chance_of_neighbours(sensor), 7)
    0.0001273
    """
    return math.prod(
        min(1.0, 2 * APART * float(error) / (high - low))
        for error, (low, high) in zip(sensor.errors, sensor.ends, strict=True)
    )
