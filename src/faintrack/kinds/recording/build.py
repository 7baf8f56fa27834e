"""From the sections of a scenario to the objects that do the work: units are converted here, once."""

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.baselines.cfar import calibrate, cell_averaging
from faintrack.baselines.detect_and_track import DetectAndTrack
from faintrack.errors import InputError
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import Likelihood
from faintrack.kinds.recording.sections import RecordingScenario, SourceTargetSection
from faintrack.kinds.several import Tracker, build_several
from faintrack.likelihoods.lobe_width import lobe_width_likelihood
from faintrack.likelihoods.unknown_noise import UnknownNoise
from faintrack.likelihoods.unknown_tone import UnknownTone
from faintrack.likelihoods.white_signal import WhiteSignal
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid, lobe_width
from faintrack.sensors.tones import PEAK, ToneGrid
from faintrack.signal.array_background import ArrayBackground, array_background
from faintrack.signal.beamformer import Beamformer
from faintrack.signal.tones import ToneAnalysis
from faintrack.targets.motion import BearingMotion, WalkingMotion
from faintrack.targets.states import BearingState, SidedState, ToneState, WaveState
from faintrack.targets.target import Target, UniformBirth
from faintrack.targets.turning import SidedMotion
from faintrack.trackers.many import ManyTargetsTracker

FAINTEST = 0.02
"""Nats that one frame tells of the faintest target by default: fifty frames for a factor e."""

CALIBRATION_FRAMES = 2000
"""Frames of noise from which the baseline's thresholds are found."""

PARTICLES = {"particles": 4000, "births": 8000}
"""Of tones, where nothing is said of them: thousands of bins in tens of beams hold one or none."""

TONES_DB = 80.0
"""From the faintest tone by default to the loudest; dB."""

LOUDEST_DB = 20.0
"""Largest SNR of a target by default; dB."""


def build_tracker(
    scenario: RecordingScenario, array: SensorArray, plan: Beamformer, noise_power: np.ndarray | None = None
) -> Tracker | DetectAndTrack:
    """Tracker of a scenario.

    Parameters
    ----------
    scenario : what to run.
    array : whose recording it is.
    plan : how its samples become scans.
    noise_power : shape (frequency,); measured, where the scenario asks for that.
    """
    snr_db = scenario.target.snr_db or default_snr_db(array, plan.grid)
    target = build_target(scenario.target, snr_db, plan.grid.circular, scenario.heading is not None)
    if scenario.tracker.method == "cfar":
        return build_baseline(scenario, array, plan, target)
    table = scenario.likelihood
    likelihood: Likelihood
    if table.kind == "unknown_noise":
        likelihood = UnknownNoise(plan.grid, snr_db, plan)
    elif table.kind == "known_noise":
        power = table.noise_power if noise_power is None else noise_power
        likelihood = WhiteSignal(plan.grid, jnp.asarray(power, jnp.float32))
    else:
        width = lobe_width(array, float(plan.grid.frequency[-1]))
        if width < 2 * np.ptp(plan.grid.bearing) / plan.grid.beams:
            raise InputError(
                "likelihood.kind lobe_width: the main lobe holds fewer than two beams; raise analysis.beams."
            )
        likelihood = lobe_width_likelihood(plan.grid, width, table.exponent)
    particles = BernoulliParticleFilter(target, scenario.filter.particles, scenario.filter.births)
    return build_several(particles, likelihood, scenario.tracker, scenario.analysis.frame, scenario.filter.guided)


def build_tones(scenario: RecordingScenario, array: SensorArray, plan: ToneAnalysis) -> Tracker:
    """Tracker of a scenario that looks for tones.

    Parameters
    ----------
    scenario : what to run.
    array : whose recording it is.
    plan : how its samples become scans.

    Raises
    ------
    InputError : the array is a line that turns: the two sides of tones are not told apart.
    """
    grid, table = plan.grid, scenario.target
    if scenario.heading is not None and not grid.circular:
        raise InputError("heading: the sides of a line are not told apart by tones; expected no heading.")
    snr_db = table.snr_db or default_tone_db(array, grid)
    band = float(grid.frequency[0]), float(grid.frequency[-1])
    target = build_target(table, snr_db, grid.circular, band=band)
    particles = BernoulliParticleFilter(target, scenario.filter.particles, scenario.filter.births)
    return build_several(particles, UnknownTone(grid), scenario.tracker, grid.frame, scenario.filter.guided)


def for_tones(scenario: RecordingScenario) -> RecordingScenario:
    """Scenario with as many particles as tones of unknown place need, where it does not say how many."""
    given = scenario.filter.model_fields_set
    chosen = {name: value for name, value in PARTICLES.items() if name not in given}
    if scenario.likelihood.kind != "tone" or not chosen:
        return scenario
    return scenario.model_copy(update={"filter": scenario.filter.model_copy(update=chosen)})


def default_tone_db(array: SensorArray, grid: ToneGrid) -> tuple[float, float]:
    """Lowest and highest SNR of tones where the scenario does not say, over the noise in 1 Hz; dB.

    A tone as loud as the noise in its bin of the beam tells little over all bins, and fainter ones nothing.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> from faintrack.signal.tones import tone_analysis
    >>> array = line_array(32, 0.375)
    >>> [round(x, 1) for x in default_tone_db(array, tone_analysis(array, 4000.0, 1.0).grid)]
    [-14.1, 65.9]
    """
    low = -10 * math.log10(PEAK * grid.frame * array.alive.sum())
    return low, low + TONES_DB


def build_background(
    scenario: RecordingScenario, tracker: Tracker | DetectAndTrack, plan: Beamformer
) -> ArrayBackground | None:
    """What learns the noise between channels, if the scenario asks for it and the tracker tells what to leave out."""
    several = isinstance(tracker, ManyTargetsTracker)
    return array_background(plan) if several and scenario.likelihood.isotropic else None


def build_baseline(scenario: RecordingScenario, array: SensorArray, plan: Beamformer, target: Target) -> DetectAndTrack:
    """Detector, its threshold found by drawing noise, and the tracks on its detections.

    Raises
    ------
    InputError : guard and window do not fit the beams.
    """
    table, grid = scenario.cfar, plan.grid
    lobe = lobe_width(array, float(np.mean(grid.frequency)))
    beams = lobe / float(grid.bearing[1] - grid.bearing[0])
    guard = math.ceil(beams) if table.guard is None else table.guard
    window = max(math.ceil(2 * beams), 4) if table.window is None else table.window
    if table.guard is None and table.window is None:
        # Short arrays have lobes so wide that no window of their own size fits.
        guard = min(guard, grid.beams // 6)
        window = min(window, (grid.beams - 1) // 2 - guard)
    detector = cell_averaging(grid, guard, window)
    calibration = calibrate(
        detector, plan, array, table.false_alarm_probability, jax.random.key(scenario.filter.seed), CALIBRATION_FRAMES
    )
    return DetectAndTrack(
        calibration.detector,
        target,
        calibration.false_detections,
        bearing_std=lobe / 4,
        lobe=lobe,
        detection_probability=table.detection_probability,
        declare=scenario.tracker.declare,
        drop=scenario.tracker.drop,
    )


def build_target(
    table: SourceTargetSection,
    snr_db: tuple[float, float],
    circular: bool,
    turns: bool = False,
    band: tuple[float, float] | None = None,
) -> Target:
    """Target of a scenario on a line array's half circle, of one that turns with its side, or on the full circle.

    Of a tone the frequency is within a band.
    """
    first, last = (-math.pi, math.pi) if circular else (0.0, math.pi)
    rate = math.radians(table.bearing_rate_deg)
    low, high = snr_db
    noise = math.radians(table.bearing_rate_noise_deg)
    level = BearingMotion(noise, table.snr_noise_db, low, high, circular)
    ends, rates = ((first, -rate, low), (last, rate, high)), (table.arrival_rate, table.departure_rate)
    if turns and not circular:
        birth = UniformBirth(*(_corner(SidedState, *values, 0.0) for values in ends))
        return Target(birth, SidedMotion(dataclasses.replace(level, circular=True)), *rates)
    if band is not None:
        walk = WalkingMotion(level, "frequency", table.frequency_noise, *band)
        corners = (_corner(ToneState, *values, frequency) for values, frequency in zip(ends, band, strict=True))
        return Target(UniformBirth(*corners), walk, *rates)
    if table.elevation_deg is None:
        return Target(UniformBirth(*(_corner(BearingState, *values) for values in ends)), level, *rates)
    lowest, highest = (math.radians(elevation) for elevation in table.elevation_deg)
    motion = WalkingMotion(level, "elevation", math.radians(table.elevation_noise_deg), lowest, highest)
    birth = UniformBirth(_corner(WaveState, *ends[0], lowest), _corner(WaveState, *ends[1], highest))
    return Target(birth, motion, *rates)


def _corner(kind: Any, *values: float) -> Any:
    return kind(*(jnp.asarray(value, jnp.float32) for value in values))


def default_snr_db(array: SensorArray, grid: BeamGrid) -> tuple[float, float]:
    r"""Lowest and highest SNR of targets where the scenario does not say; dB.

    Notes
    -----
    A frame of F bins and K snapshots tells on average :math:`F K (M a - \log(1 + M a)) \approx F K (M a)^2 / 2`
    nats of a target with SNR a. Fainter than `FAINTEST` it could not be told from no target, and existence would mean
    nothing.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> from faintrack.signal.beamformer import beamformer
    >>> array = line_array(32, 0.375)
    >>> [round(x, 1) for x in default_snr_db(array, beamformer(array, 4000.0).grid)]
    [-38.5, 20.0]
    """
    cells = grid.frequency.size * grid.snapshots
    gain = math.sqrt(2 * FAINTEST / cells)
    return 10 * math.log10(gain / array.alive.sum()), LOUDEST_DB
