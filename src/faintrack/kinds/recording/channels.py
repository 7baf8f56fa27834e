"""Whether the channels of a recording are what its array says: looked at in the frames where most is heard."""

import heapq
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from faintrack.kinds.checks import about_channels
from faintrack.signal.beamformer import Beamformer
from faintrack.signal.channels import LEAST, evidence
from faintrack.signal.channels import doubts as doubts_of

FRAMES = 24
"""Frames that are looked at, at most."""

FRAMES_BYTES = 32 * 2**20
"""Their samples that are held."""


@dataclass
class LoudFrames:
    """Frames in which most is heard, few enough to be held.

    Attributes
    ----------
    plan : how samples become spectra.
    """

    plan: Beamformer
    _frames: list[tuple[float, int, np.ndarray]] = field(default_factory=list)

    def take(
        self, start: int, samples: Float[np.ndarray, "frame sample channel"], existence: Float[np.ndarray, "frame slot"]
    ) -> None:
        """Keep those of some consecutive frames in which a target is likeliest.

        Parameters
        ----------
        start : number of the first.
        samples, existence : of each.
        """
        room = max(1, min(FRAMES, FRAMES_BYTES // samples[0].nbytes))
        for number, (frame, likely) in enumerate(zip(samples, existence.max(axis=1), strict=True)):
            each = (float(np.nan_to_num(likely)), -start - number, frame)
            if len(self._frames) < room:
                heapq.heappush(self._frames, (*each[:2], frame.copy()))
            elif each[:2] > self._frames[0][:2]:
                heapq.heapreplace(self._frames, (*each[:2], frame.copy()))

    def doubts(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Sentences about channels that are not as the array says, by their names."""
        spectra = self._spectra()
        return () if spectra is None else about_channels(names, doubts_of(self.plan.grid, spectra))

    def checked(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """As `doubts`, and where there is nothing to say, whether there was anything to tell it by."""
        found, spectra = self.doubts(names), self._spectra()
        if found:
            return found
        nats = 0.0 if spectra is None else evidence(self.plan.grid, spectra)
        if nats < LEAST:
            return ("No source is heard in the frames that were looked at: channels cannot be told right from wrong.",)
        return (
            f"Channels agree: with no other polarity, gain or order a source ({nats:.0f} nats) is heard much better.",
        )

    def _spectra(self) -> np.ndarray | None:
        if not self._frames:
            return None
        samples = np.stack([frame for _, _, frame in self._frames])
        return np.asarray(self.plan.spectra(jnp.asarray(samples)))
