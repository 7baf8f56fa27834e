"""Recordings of arrays through a beamformer, for every kind of data that begins with samples."""

import math

from faintrack.data.recording import Recording
from faintrack.errors import InputError, naming
from faintrack.scenario.sections import AnalysisSection
from faintrack.sensors.array import SensorArray
from faintrack.signal.beamformer import Beamformer, beamformer


def build_beamformer(
    analysis: AnalysisSection,
    array: SensorArray,
    sample_rate: float,
    taper: bool = False,
    elevation: tuple[float, float] | None = None,
) -> Beamformer:
    """Beamformer of a scenario's analysis for an array and a sample rate, with a taper or without.

    Parameters
    ----------
    analysis, array, sample_rate, taper : what `faintrack.signal.beamformer.beamformer` is asked for.
    elevation : lowest and highest of the waves, degrees; all are level where not given.

    Raises
    ------
    InputError : band, frame and sample rate do not fit together, or the array cannot tell elevations.
    """
    rings = None if elevation is None else (math.radians(elevation[0]), math.radians(elevation[1]))
    sizes = analysis.frame, analysis.band, analysis.beams, analysis.snapshot
    return beamformer(array, sample_rate, *sizes, taper=taper, elevation=rings)


def plan_frames(
    recording: Recording,
    array: SensorArray,
    analysis: AnalysisSection,
    taper: bool = False,
    elevation: tuple[float, float] | None = None,
) -> tuple[Beamformer, int, int]:
    """Beamformer of a recording, samples of a frame, and number of frames.

    Parameters
    ----------
    recording, array : samples, and the geometry of their channels.
    analysis, taper, elevation : as of `build_beamformer`.

    Raises
    ------
    InputError : recording, array, band and frame do not fit together.
    """
    if recording.channels != len(array.gains):
        raise InputError(f"{recording.source} has {recording.channels} channels; the array has {len(array.gains)}.")
    with naming(recording.source):
        plan = build_beamformer(analysis, array, recording.sample_rate, taper, elevation)
    length = round(analysis.frame * recording.sample_rate)
    count = recording.length // length
    if count == 0:
        raise InputError(
            f"{recording.source} lasts {recording.duration:g} s; expected at least one frame of {analysis.frame:g} s."
        )
    return plan, length, count
