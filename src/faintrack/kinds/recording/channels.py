"""Whether array and waves are what they are taken for: looked at in the frames where most is heard."""

import heapq
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from faintrack.kinds.checks import about_channels, about_crossing
from faintrack.signal.beamformer import Beamformer
from faintrack.signal.channels import LEAST, Doubt, doubts, evidence
from faintrack.signal.trace_velocity import Crossing, crossing

FRAMES = 24
"""Frames of each kind that are looked at, at most."""

FRAMES_BYTES = 32 * 2**20
"""Their samples that are held."""

HELD = 0.5
"""Existence from which on what is heard in a frame is a target's."""

Loudest = list[tuple[float, int, np.ndarray]]


@dataclass
class LoudFrames:
    """Frames in which most is heard, few enough to be held: of targets, and of what no target explains.

    Attributes
    ----------
    plan : how samples become spectra.
    """

    plan: Beamformer
    _frames: Loudest = field(default_factory=list)
    _unexplained: Loudest = field(default_factory=list)

    def take(
        self,
        start: int,
        samples: Float[np.ndarray, "frame sample channel"],
        existence: Float[np.ndarray, "frame slot"],
        record: Float[np.ndarray, "frame beam"] | None = None,
    ) -> None:
        """Keep those of some consecutive frames in which a target is likeliest, and the loudest without one.

        Parameters
        ----------
        start : number of the first.
        samples, existence : of each.
        record : of each, by which those without a target are judged; none of them is kept where it is not given.
        """
        likely = np.nan_to_num(existence.max(axis=1))
        for number, frame in enumerate(samples):
            _keep(self._frames, float(likely[number]), start + number, frame)
            if record is not None and likely[number] < HELD:
                _keep(self._unexplained, float(record[number].max()), start + number, frame)

    def misfits(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Sentences about waves and channels that are not as the array says."""
        across, wrong = self._judged(self._spectra(self._frames))
        if across is None and not wrong:
            # Nothing is said of channels by frames without a target, unless it explains a wave that seemed not level.
            spectra = self._spectra(self._unexplained)
            found = None if spectra is None else crossing(self.plan.grid, spectra)
            if found is not None and found.unexpected:
                across, wrong = self._judged(spectra)
        array = self.plan.grid.array
        assert array is not None
        waves = () if across is None else about_crossing(across, array.sound_speed)
        return (*waves, *about_channels(names, wrong))

    def checked(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """As `misfits`, and where there is nothing to say, whether there was anything to tell it by."""
        found, spectra = self.misfits(names), self._spectra(self._frames)
        if found:
            return found
        nats = 0.0 if spectra is None else evidence(self.plan.grid, spectra, self._slowness(spectra))
        if nats < LEAST:
            return ("No source is heard in the frames that were looked at: channels cannot be told right from wrong.",)
        return (
            f"Channels agree: with no other polarity, gain or order a source ({nats:.0f} nats) is heard much better.",
        )

    def _judged(self, spectra: np.ndarray | None) -> tuple[Crossing | None, list[Doubt]]:
        """Waves that are not what is expected, or channels that are not: what has more of the evidence."""
        if spectra is None:
            return None, []
        grid = self.plan.grid
        across, wrong = crossing(grid, spectra), doubts(grid, spectra, self._slowness(spectra))
        if across is None or not across.unexpected:
            return None, wrong
        if wrong and wrong[-1].after >= evidence(grid, spectra, across.slowness):
            return None, wrong
        return across, doubts(grid, spectra, across.slowness)

    def _slowness(self, spectra: np.ndarray) -> float:
        """Of the waves that are expected, as far as they are heard."""
        across = crossing(self.plan.grid, spectra) if self.plan.grid.elevations else None
        return 1.0 if across is None else float(np.clip(across.slowness, *across.expected))

    def _spectra(self, frames: Loudest) -> np.ndarray | None:
        if not frames:
            return None
        return np.asarray(self.plan.spectra(jnp.asarray(np.stack([frame for _, _, frame in frames]))))


def _keep(frames: Loudest, rank: float, number: int, frame: np.ndarray) -> None:
    """Take a frame in where it is among the highest, the earlier before the later."""
    # A plan may be run a second time.
    if any(number == -other for _, other, _ in frames):
        return
    room = max(1, min(FRAMES, FRAMES_BYTES // frame.nbytes))
    key = (rank, -number)
    if len(frames) < room:
        heapq.heappush(frames, (*key, frame.copy()))
    elif key > frames[0][:2]:
        heapq.heapreplace(frames, (*key, frame.copy()))
