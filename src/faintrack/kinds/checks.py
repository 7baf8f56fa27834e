"""Set-ups of arrays that can tell little or nothing: told before a run, by `faintrack info` and in the report."""

from collections.abc import Sequence

import numpy as np

from faintrack.data.recording import Recording
from faintrack.scenario.array import ArrayDescription
from faintrack.sensors.array import SensorArray, straightened
from faintrack.signal.beamformer import Beamformer
from faintrack.signal.channels import Doubt
from faintrack.signal.trace_velocity import Crossing

SMALLEST, LARGEST = 0.25, 2000.0
"""Lengths of the shortest wave that an array spans at least to tell a bearing, and at most to be an array of one."""

STRAIGHT = 1 / 20
"""Of the shortest wave: channels that lie within it of a line cannot tell its sides apart, as phases differ by less
than two thirds of a radian."""

TRANSITS = 4.0
"""Times that a wave takes along the array which a transform lasts at least, else the channels hear different parts."""

FREQUENCIES = 16
"""Of a band, at which its response is looked at."""

GRATING = 0.8
"""Power of a wave from elsewhere in a beam, over that of one from where it points, that makes the two alike."""

LOUDER_DB, SECONDS = 30.0, 5.0
"""By how much one channel differs from the others before it is told, over the first seconds."""


def as_heard(array: SensorArray, highest: float) -> tuple[SensorArray, tuple[str, ...]]:
    """Array as waves up to a frequency see it: one that is nearly a line is a line.

    Parameters
    ----------
    array : as described.
    highest : frequency; Hz.
    """
    wave = array.sound_speed / highest
    line, off = straightened(array, STRAIGHT * wave)
    if line is array or _aperture(array) < SMALLEST * wave:
        return array, ()
    return line, (
        f"The channels lie within {off:.3g} m of a line, less than a twentieth of the shortest wave, {wave:.3g} m: its "
        "two sides cannot be told apart, and bearings are from its axis.",
    )


def _aperture(array: SensorArray) -> float:
    """Largest distance between two channels in use; metres."""
    used = array.positions[array.alive]
    return float(np.linalg.norm(used[:, None] - used[None], axis=-1).max())


def about_array(
    array: SensorArray, described: ArrayDescription | None, plan: Beamformer, sample_rate: float
) -> tuple[str, ...]:
    """What an array cannot tell in a band; one sentence each.

    Parameters
    ----------
    array : whose channels are heard.
    described : what it was made from; None where it was made in memory.
    plan : for a recording of it.
    sample_rate : Hz.
    """
    aperture, highest = _aperture(array), float(plan.grid.frequency[-1])
    wave = array.sound_speed / highest
    remarks = []
    if described is not None and described.sound_speed is None:
        remarks.append(f"The array does not tell the sound speed; {array.sound_speed:g} m/s was taken.")
    if aperture < SMALLEST * wave:
        remarks.append(
            f"The array is {aperture:.3g} m long and the shortest wave {wave:.3g} m: it hardly tells a bearing. "
            "Are the positions in metres, and is the sound speed that of the medium?"
        )
    elif aperture > LARGEST * wave:
        remarks.append(
            f"The array is {aperture:.3g} m long, {aperture / wave:.3g} times the shortest wave, {wave:.3g} m: "
            "hardly any beam meets a source. Are the positions in metres?"
        )
    elif (lobe := _grating_lobe(array, plan.grid.frequency)) is not None:
        remarks.append(
            f"In this band the array hears a wave from {lobe[0]:.0f} degrees as one from {lobe[1]:.0f} degrees "
            "(grating lobes): a wider band, or a lower one, tells them apart."
        )
    transit, length = aperture / array.sound_speed, plan.snapshot / sample_rate
    if length < TRANSITS * transit:
        remarks.append(
            f"A transform lasts {length:.3g} s and a wave takes {transit:.3g} s along the array: the channels hear "
            "different parts of it. Expected a longer analysis.frame or analysis.snapshot."
        )
    return tuple(remarks)


def about_levels(recording: Recording, array: SensorArray) -> tuple[str, ...]:
    """Channels whose level is far from that of the others; one sentence each."""
    samples = np.asarray(recording.read(0, min(recording.length, round(SECONDS * recording.sample_rate))), float)
    with np.errstate(all="ignore"):
        power = (
            np.array(
                [
                    np.mean(column[np.isfinite(column)] ** 2) if np.isfinite(column).any() else np.nan
                    for column in samples.T
                ]
            )
            * array.gains**2
        )
        level = 10 * np.log10(np.where((power > 0) & array.alive, power, np.nan))
    if np.isnan(level).all():
        return ()
    off = level - np.nanmedian(level)
    return tuple(
        f"Channel {recording.channel_names[number]} is {abs(off[number]):.0f} dB "
        f"{'louder' if off[number] > 0 else 'quieter'} than the others in the first seconds: expected a gain in the "
        "array that corrects it, or the channel in its list of dead ones."
        for number in np.flatnonzero(np.abs(np.nan_to_num(off)) > LOUDER_DB)
    )


def about_channels(names: Sequence[str], found: Sequence[Doubt]) -> tuple[str, ...]:
    """Channels with which a source is much better heard changed; one sentence each.

    Parameters
    ----------
    names : of all channels.
    found : by `faintrack.signal.channels.doubts`.
    """
    remarks = []
    for doubt in found:
        told = f"the evidence of a source is {doubt.before:.0f} nats as it is and {doubt.after:.0f} with that changed"
        if len(doubt.channels) == 2:
            one, two = (names[number] for number in doubt.channels)
            remarks.append(f"Channels {one} and {two} seem to be exchanged: {told}. Is their order that of the array?")
        elif doubt.factor < 0:
            name = names[doubt.channels[0]]
            remarks.append(
                f"Channel {name} seems to have its poles reversed: {told}. List it in inverted of the array, or "
                "take it out of there."
            )
        else:
            name, size = names[doubt.channels[0]], "half" if doubt.factor > 1 else "twice"
            remarks.append(
                f"Channel {name} seems to have {size} the gain of the others: {told}. Multiply its gain in the array "
                f"by {doubt.factor:g}."
            )
    return tuple(remarks)


def about_crossing(across: Crossing, sound_speed: float) -> tuple[str, ...]:
    """Waves that cross an array at another speed than is expected; one sentence.

    Parameters
    ----------
    across : of frames in which that is so.
    sound_speed : along the array; m/s.
    """
    bearing, trace = np.degrees(across.bearing), sound_speed / across.slowness
    where = f"What is heard from about {bearing:.0f} degrees crosses the array at {trace:.0f} m/s"
    lost = f"bearings that are given take {across.inside:.0f} of its {across.free:.0f} nats"
    if across.slowness > 1:
        return (
            f"{where}, slower than sound, {sound_speed:g} m/s: expected another sound_speed of the array, or a source "
            f"farther off than the array is long; {lost}, and are wrong or missing.",
        )
    above = np.degrees(np.arccos(across.slowness))
    taken = "for level" if across.expected == (1.0, 1.0) else "as in target.elevation_deg"
    return (
        f"{where}, not {sound_speed:g}: from {above:.0f} degrees above the horizon, where waves are taken {taken}; "
        f"expected target.elevation_deg, as [0, 80]. As it is {lost}, and are wrong "
        "or missing.",
    )


def _grating_lobe(array: SensorArray, frequency: np.ndarray) -> tuple[float, float] | None:
    """Two bearings that an array cannot tell apart in a band, degrees; None where there are none."""
    bearing = np.linspace(-np.pi, np.pi, 721) if array.circular else np.linspace(0, np.pi, 361)
    delays = np.asarray(array.delays(bearing))[:, array.alive]
    rows = np.arange(0, len(bearing), 8)
    power = np.zeros((len(rows), len(bearing)))
    for one in frequency[:: max(1, len(frequency) // FREQUENCIES)]:
        steering = np.exp(-2j * np.pi * one * delays)
        power += np.abs(steering[rows].conj() @ steering.T / steering.shape[1]) ** 2
    power /= power.max()
    for row, response in zip(rows, power, strict=True):
        # Beyond the main lobe, either way round: where the response has fallen below a half in between.
        lowest = np.minimum.accumulate
        between = np.concatenate([lowest(response[row::-1])[::-1], lowest(response[row:])[1:]])
        beyond = (response > GRATING) & (between < 0.5)
        if array.circular:
            from_start, to_end = lowest(response), lowest(response[::-1])[::-1]
            place = np.arange(len(bearing))
            beyond &= np.minimum(from_start[np.minimum(place, row)], to_end[np.maximum(place, row)]) < 0.5
        if beyond.any():
            return float(np.degrees(bearing[np.argmax(beyond)])), float(np.degrees(bearing[row]))
    return None
