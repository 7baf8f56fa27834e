r"""Cell-averaging CFAR detection on the beams of a frame.

The response of a beam is its power over that of the noise, summed over the band. A beam is detected where it exceeds
the mean of the reference beams around it, past a guard as wide as the main lobe, by a factor that depends on the
bearing alone:

.. math::
    R(\psi) = \sum_f \frac{B_f(\psi)}{\sigma_f^2}, \qquad
    \frac{R(\psi)}{\frac{1}{|W(\psi)|} \sum_{\alpha \in W(\psi)} R(\alpha)} > T(\psi)

(Mallick, Krishnamurthy and Vo 2013, p. 323, for the detector; bosser2022, section IV, puts it in front of a Kalman
filter.) Neighbouring beams hear the same noise, so T is not that of independent cells: `calibrate` finds it by drawing
noise. Where a run of beams exceeds, the local maxima are the detections, their bearing refined by a parabola.

At the ends of a line the window has one side only; on a circle it goes round.
"""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.numerics.precision import full_precision
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid, BeamScan
from faintrack.signal.beamformer import Beamformer
from faintrack.simulation.spectra import over_spectra


class Detections(eqx.Module):
    """What one frame shows: a place for every beam, most of them empty.

    Attributes
    ----------
    bearing : of the local maximum at each beam; radians.
    level : response over the mean of the reference beams, at every beam.
    found : whether there is a detection at the beam.
    """

    bearing: Float[Array, " beam"]
    level: Float[Array, " beam"]
    found: Bool[Array, " beam"]


class CellAveraging(eqx.Module):
    """Detector; make one with `cell_averaging`.

    Attributes
    ----------
    grid : axes of the scans.
    reference : shape (beam, beam); weights of the reference beams of each beam, rows sum to 1.
    threshold : shape (beam,); level that counts as a detection.
    noise_power : shape () or (frequency,); of the noise in each bin. Where None, of each frame and frequency the mean
        over the channels.
    """

    grid: BeamGrid
    reference: Float[Array, "bearing bearing"]
    threshold: Float[Array, " bearing"]
    noise_power: Float[Array, "*frequency"] | None = None

    @full_precision
    def level(self, scan: BeamScan) -> Float[Array, " bearing"]:
        """Response of each beam over the mean of its reference beams."""
        if self.noise_power is None:
            heard = scan.total_power > 0
            weights = jnp.where(heard, 1 / jnp.where(heard, scan.total_power, 1), 0)
        else:
            weights = jnp.broadcast_to(1 / self.noise_power, scan.total_power.shape)
        response = jnp.sum(weights[:, None] * scan.beam_power, axis=0)
        around = self.reference @ response
        return jnp.where(around > 0, response / jnp.where(around > 0, around, 1), 1.0)

    def detect(self, scan: BeamScan) -> Detections:
        """Local maxima above the threshold."""
        level = self.level(scan)
        before, after = _beside(level, self.grid.circular)
        found = (level > self.threshold) & (level >= before) & (level > after) & (scan.channels >= 2)
        bend = 2 * level - before - after
        offset = jnp.where(bend > 0, (after - before) / jnp.where(bend > 0, 2 * bend, 1), 0)
        bearing = jnp.asarray(self.grid.bearing, level.dtype)
        spacing = float(self.grid.bearing[1] - self.grid.bearing[0])
        return Detections(bearing + spacing * jnp.clip(offset, -0.5, 0.5), level, found)


def cell_averaging(
    grid: BeamGrid,
    guard: int,
    window: int,
    threshold: float = math.inf,
    noise_power: Float[Array, "*frequency"] | None = None,
) -> CellAveraging:
    """Detector with one threshold for all beams; `calibrate` gives each its own.

    Parameters
    ----------
    grid : axes of the scans.
    guard : beams left out on either side of the one that is tested.
    window : reference beams beyond them, on either side.
    threshold : level that counts as a detection.
    noise_power : as in `CellAveraging`.

    Raises
    ------
    InputError : guard and window leave a beam without reference, or go round the circle.

    Examples
    --------
    >>> grid = BeamGrid(np.array([1.0]), beams=9, snapshots=1, circular=False)
    >>> cell_averaging(grid, guard=1, window=2).reference[0].tolist()
    [0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    """
    apart = np.abs(np.subtract.outer(np.arange(grid.beams), np.arange(grid.beams)))
    if grid.circular:
        apart = np.minimum(apart, grid.beams - apart)
    if guard < 0 or window < 1 or 2 * (guard + window) >= grid.beams:
        raise InputError(
            f"CFAR guard {guard} and window {window} beams; expected a guard of 0 or more, a window of 1 or more, and "
            f"both together less than half of the {grid.beams} beams."
        )
    inside = ((apart > guard) & (apart <= guard + window)).astype(np.float32)
    reference = jnp.asarray(inside / inside.sum(axis=1, keepdims=True))
    return CellAveraging(grid, reference, jnp.full(grid.beams, threshold, jnp.float32), noise_power)


class Calibration(eqx.Module):
    """A detector whose false-alarm probability is known.

    Attributes
    ----------
    detector : with the thresholds found.
    false_detections : mean number of detections in a frame of noise.
    """

    detector: CellAveraging
    false_detections: Float[Array, ""]


@eqx.filter_jit
def calibrate(
    detector: CellAveraging,
    plan: Beamformer,
    array: SensorArray,
    false_alarm_probability: float,
    key: PRNGKeyArray,
    frames: int = 4000,
) -> Calibration:
    """Set the threshold of every beam by drawing white noise.

    Parameters
    ----------
    detector : window and guard; its threshold is replaced.
    plan, array : how samples become scans, and of which array.
    false_alarm_probability : that a given beam exceeds its threshold in a frame of noise.
    key : random key.
    frames : drawn; the probability is good to one part in the root of frames times probability.
    """

    def take_in(state: None, number: Array, spectra: Array) -> tuple[None, Array]:
        return state, detector.level(plan.scan_frame(number * 1.0, spectra))

    silence = jnp.zeros(frames), jnp.full(frames, -jnp.inf)
    # A level is free of scale, so noise of power 1 serves where none is known.
    noise_power = 1.0 if detector.noise_power is None else detector.noise_power
    levels = over_spectra(take_in, None, key, array, plan.grid, *silence, noise_power)[1]
    threshold = jnp.quantile(levels, 1 - false_alarm_probability, axis=0)
    calibrated = dataclasses.replace(detector, threshold=threshold)

    before, after = jax.vmap(lambda level: _beside(level, plan.grid.circular))(levels)
    found = (levels > threshold) & (levels >= before) & (levels > after)
    return Calibration(calibrated, jnp.mean(jnp.sum(found, axis=1).astype(levels.dtype)))


def _beside(level: Float[Array, " beam"], circular: bool) -> tuple[Float[Array, " beam"], Float[Array, " beam"]]:
    """Levels of the beams before and after each; mirrored at the ends, as the beams of a line are beyond them."""
    if circular:
        return jnp.roll(level, 1), jnp.roll(level, -1)
    return jnp.concatenate([level[1:2], level[:-1]]), jnp.concatenate([level[1:], level[-2:-1]])
