"""The background of each pair of a multistatic sonar, learnt as the data come.

Reverberation, level and clutter are those of a receiver and of the pulse that it hears, so every pair has a background
of its own (`faintrack.signal.returns_background`). A pair that does not report learns nothing.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.sensors.multistatic import Pings
from faintrack.signal.returns_background import Heard, Read, ReturnsBackground


class MultistaticRead(eqx.Module):
    """Pings as their backgrounds have them.

    Attributes
    ----------
    ping : with rates and powers of each pair.
    reads : of each pair, see `faintrack.signal.returns_background.Read`.
    """

    ping: Pings
    reads: tuple[Read, ...]

    @property
    def expected(self) -> Float[Array, " pair"]:
        """Number of returns of each pair; 0 where it does not report."""
        return jnp.where(self.ping.reported, jnp.stack([read.expected for read in self.reads]), 0)

    @property
    def shape(self) -> Float[Array, " pair"]:
        """Of the tail of each pair."""
        return jnp.stack([read.shape for read in self.reads])


class MultistaticBackground(eqx.Module):
    """Learns how often bins of each pair exceed the threshold without a target, and how far.

    Attributes
    ----------
    backgrounds : of each pair.
    """

    backgrounds: tuple[ReturnsBackground, ...]

    def init(self) -> tuple[Heard, ...]:
        """What is remembered before any ping."""
        return tuple(each.init() for each in self.backgrounds)

    def read(self, heard: tuple[Heard, ...], scan: Pings) -> MultistaticRead:
        """Pings as the backgrounds have them.

        Parameters
        ----------
        heard : so far, by each pair.
        scan : with powers over the mean of the model's noise.
        """
        reads = tuple(
            each.read(before, ping) for each, before, ping in zip(self.backgrounds, heard, scan.pings, strict=True)
        )
        return MultistaticRead(dataclasses.replace(scan, pings=tuple(read.ping for read in reads)), reads)

    def learn(
        self,
        heard: tuple[Heard, ...],
        scan: Pings,
        read: MultistaticRead,
        of_targets: tuple[Float[Array, " return"], ...],
    ) -> tuple[Heard, ...]:
        """What is remembered after a ping.

        Parameters
        ----------
        heard : before it, by each pair.
        scan, read : it, as it is and as the backgrounds have it.
        of_targets : probability that each return is an echo of a target in hand, of each pair.
        """
        after = []
        for number, (each, before) in enumerate(zip(self.backgrounds, heard, strict=True)):
            learnt = each.learn(before, scan.pings[number], read.reads[number], of_targets[number])
            there = scan.reported[number]
            after.append(jax.tree.map(lambda new, old, there=there: jnp.where(there, new, old), learnt, before))
        return tuple(after)
