"""What is particular to recordings about data without a target: how far channels are shifted, and the odds' gain."""

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.kinds.recording.plan import array_of
from faintrack.kinds.recording.sections import RecordingScenario
from faintrack.kinds.surrogates import shifted_apart
from faintrack.metrics.false_tracks import odds_rate


def surrogate(recording: Recording, scenario: RecordingScenario, seed: int) -> Recording:
    """Recording without the sources that it holds: channels shifted apart by a frame and what a wave takes across.

    Raises
    ------
    InputError : there is no array, the recording is too short, or tones are looked for, which are as steady when
        channels are shifted.
    """
    if scenario.likelihood.kind == "tone":
        raise InputError(
            "a tone is as steady when channels are shifted apart, so that data without a target cannot be made of "
            "others; expected stretches without one."
        )
    array, _ = array_of(recording, scenario)
    across = np.linalg.norm(array.positions[:, None] - array.positions[None], axis=-1).max()
    return shifted_apart(recording, float(across / array.sound_speed) + scenario.analysis.frame, seed)


def gained(scenario: RecordingScenario) -> float | None:
    """See `faintrack.kinds.kind.Kind`: neither "cfar" nor "lobe_width" are likelihood ratios."""
    if scenario.tracker.method != "bernoulli" or scenario.likelihood.kind == "lobe_width":
        return None
    return odds_rate(scenario.target.arrival_rate, scenario.target.departure_rate)
