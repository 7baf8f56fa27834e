r"""Returns of a sonar from the samples of its hydrophones, and samples drawn with echoes.

Of every ping the samples from its first delay to its last one are beamformed and correlated with replicas of the pulse
(`faintrack.signal.matched_filter`), which gives one value a bin of delay, beam and Doppler. It is compensated for
range, normalised, and what exceeds `sonar.threshold_db` are the returns, as a file of them has. A ping is held at a
time.
"""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float

from faintrack.data.recording import Recording
from faintrack.data.returns import LOUDEST_DB, Returns
from faintrack.errors import InputError, naming
from faintrack.io.arrays import matched as in_order
from faintrack.io.recordings import read as read_recording
from faintrack.kinds.planar import Targets, states_of
from faintrack.kinds.returns.build import build_sonar
from faintrack.kinds.returns.sections import PulseSection, ReceptionSection, ReturnsScenario, SonarSection
from faintrack.scenario.array import build
from faintrack.sensors.active import ActiveSonar
from faintrack.sensors.array import SensorArray
from faintrack.signal.matched_filter import Waveform, coded, matched, recorded, split_window, sweep


def waveform(table: PulseSection) -> Waveform:
    """Pulse of a scenario as a function of time.

    Raises
    ------
    InputError : the file of the replica cannot be read, or has several channels.
    """
    if table.replica is not None:
        recording = read_recording(table.replica)
        if recording.channels != 1:
            raise InputError(f"{table.replica} has {recording.channels} channels; expected the pulse in one.")
        samples = np.asarray(recording.read(0, recording.length), float)[:, 0]
        return recorded(samples, recording.sample_rate, table.frequency)
    if table.code is not None:
        return coded(table.frequency, table.duration, table.code)
    return sweep(table.frequency, table.duration, table.bandwidth, table.sweep == "hyperbolic")


def returns_of(recording: Recording, scenario: ReturnsScenario) -> Returns:
    """Returns of the pings in a recording.

    Raises
    ------
    InputError : the scenario lacks the array, the reception or a single source and receiver, or the recording holds no
        whole ping or cannot hold the pulse.
    """
    array, reception, table = _reception(scenario)
    array, rule = in_order(array, recording)
    if array.axis is not None:
        raise InputError(
            "array: the channels lie on a line, which hears an echo from both sides alike; expected an array that is "
            "no line."
        )
    sonar, pulse, rate = build_sonar(table), waveform(_pulse(table)), recording.sample_rate
    _require_band(pulse, table, rate, recording.source)
    guard, window = reception.guard, reception.window
    # Cells before the first and after the last bin serve the normaliser alone.
    before = min(guard + window, max(0, math.floor((sonar.delay.first - pulse.duration) / sonar.delay.step)))
    count = sonar.delay.count + before + guard + window
    delays = sonar.delay.first + sonar.delay.step * (np.arange(count) - before)
    times, left = ping_times(recording, reception, float(delays[-1]) + pulse.duration)
    shifts = np.zeros(1) if sonar.doppler is None else sonar.doppler.values
    replicas = [pulse.samples(rate, float(shift)) for shift in shifts]
    bearings = math.pi / 2 - sonar.beam_step * np.arange(sonar.beams)
    gain = (delays / delays[-1]) ** (reception.compensation_db / 10)
    threshold = 10 ** (table.threshold_db / 10)
    found: list[np.ndarray] = []
    powers: list[np.ndarray] = []
    for number, time in enumerate(times):
        start = round((time + delays[0]) * rate)
        at = np.round((time + delays) * rate).astype(int) - start
        stop = start + int(at[-1]) + max(map(len, replicas))
        samples = np.nan_to_num(np.asarray(recording.read(start, stop), float))
        for beam, output in enumerate(matched(samples, array, bearings, replicas, rate)):
            power = split_window(np.abs(output[:, at]) ** 2 * gain, guard, window)[
                :, before : before + sonar.delay.count
            ]
            doppler, delay = np.nonzero(power > threshold)
            ping = np.full(len(delay), number)
            found.append(np.stack([ping, delay, np.full(len(delay), beam), doppler], axis=1))
            powers.append(np.minimum(power[doppler, delay], 10 ** (LOUDEST_DB / 10)))
    bins, power = np.concatenate(found), np.concatenate(powers)
    order = np.lexsort((bins[:, 3], bins[:, 2], bins[:, 1], bins[:, 0]))
    ping, delay, beam, doppler = bins[order].T
    return Returns(
        times,
        ping,
        sonar.delay.values[delay],
        beam * sonar.beam_step,
        power[order],
        None if sonar.doppler is None else sonar.doppler.values[doppler],
        None,
        None,
        np.arange(len(ping)),
        recording.source,
        remarks=(*recording.remarks, *rule, *left),
    )


def read(paths: tuple[Path, ...], scenario: ReturnsScenario | None) -> Returns:
    """Returns of the pings in files of samples.

    Raises
    ------
    InputError : as `returns_of`, or a file cannot be read.
    """
    if scenario is None:
        raise InputError(f"{paths[0]} holds samples; expected a scenario with [sonar], [reception] and an array.")
    with naming(paths[0]):
        # What is lacking is told before a long file is read.
        _reception(scenario)
    return returns_of(read_recording(*paths), scenario)


def ping_times(
    recording: Recording, reception: ReceptionSection, lasts: float
) -> tuple[Float[np.ndarray, " ping"], tuple[str, ...]]:
    """Times of the pings that are whole in a recording, and how many are not.

    Raises
    ------
    InputError : there is none.
    """
    room = recording.duration - lasts - 1 / recording.sample_rate
    if reception.ping_times is not None:
        times = np.array(reception.ping_times)
    else:
        assert reception.interval is not None
        number = math.floor((recording.duration - reception.first_ping) / reception.interval + 1e-9) + 1
        times = reception.first_ping + reception.interval * np.arange(max(number, 1))
        times = times[times < recording.duration]
    whole = times <= room
    if not whole.any():
        raise InputError(
            f"{recording.source} lasts {recording.duration:g} s; expected at least one whole ping, {lasts:g} s with "
            "its last delay, the normaliser's window and the pulse."
        )
    left = int((~whole).sum())
    remarks = (f"{left} pings that the recording does not hold whole were left out.",) if left else ()
    return times[whole], remarks


def tail_shape(table: SonarSection, reception: ReceptionSection) -> float:
    """Shape of the tail that the normaliser leaves, 1/N of the independent cells in its window."""
    sonar, pulse = build_sonar(table), _pulse(table)
    width = 1 / max(pulse.bandwidth, 1 / pulse.duration)
    return 1 / (2 * reception.window * min(1.0, sonar.delay.step / width))


def with_reception(scenario: ReturnsScenario) -> ReturnsScenario:
    """Scenario with what follows from its reception: an echo's bins fade together, and the tail of the normaliser."""
    background, reception = scenario.background, scenario.reception
    if reception is None:
        return scenario
    if scenario.sonar.fading is None:
        scenario = scenario.model_copy(update={"sonar": scenario.sonar.model_copy(update={"fading": "ping"})})
    if background.shape is not None or not background.learn or scenario.tracker.targets == 1:
        return scenario
    shape = tail_shape(next(iter(scenario.pairs.values())), reception)
    return scenario.model_copy(update={"background": background.model_copy(update={"shape": min(shape, 0.5)})})


def draw_samples(scenario: ReturnsScenario, targets: Targets, seed: int) -> Recording:
    """Recording of the pings that a scenario's `[simulation]` describes: echoes in white noise of unit variance.

    An echo is the pulse with the target's Doppler shift and an amplitude that is Gaussian anew in every ping, of the
    mean power that gives `sonar.snr_db` behind beamformer and matched filter. Samples are drawn ping by ping.

    Raises
    ------
    InputError : as `returns_of`, or the pings are not at even times or overlap.
    """
    array, reception, table = _reception(scenario)
    assert scenario.simulation is not None
    sonar, pulse = build_sonar(table), waveform(_pulse(table))
    rate, interval, count = reception.sample_rate, scenario.simulation.interval, scenario.simulation.pings
    lasts = sonar.delay.values[-1] + sonar.delay.step * (reception.guard + reception.window + 1) + pulse.duration
    if reception.interval != interval or rate is None or lasts + reception.first_ping > interval:
        raise InputError(
            f"simulation of samples: expected reception.sample_rate, reception.interval as simulation.interval, "
            f"{interval:g} s, and in it reception.first_ping and a ping of {lasts:.4g} s."
        )
    _require_band(pulse, table, rate, "simulation")
    size = round(interval * rate)

    def block(number: int) -> np.ndarray:
        rng = np.random.default_rng([seed, number])
        samples = rng.standard_normal((size, len(array.gains)))
        _add_echoes(samples, array, sonar, pulse, table, targets, number * interval, reception.first_ping, rate, rng)
        return (samples * np.where(array.alive, 1 / np.where(array.alive, array.gains, 1), 0)).astype(np.float32)

    held: dict[int, np.ndarray] = {}

    def read(start: int, stop: int) -> np.ndarray:
        parts = []
        for number in range(start // size, -(-stop // size)):
            if number not in held:
                held.clear()
                held[number] = block(number)
            parts.append(held[number][max(start - number * size, 0) : stop - number * size])
        return np.concatenate(parts)

    return Recording(read, count * size, rate, array.channel_names, source="simulation")


def blocks(recording: Recording) -> Iterator[np.ndarray]:
    """Consecutive samples to write."""
    return recording.blocks(max(1, 2**20 // recording.channels))


def _add_echoes(
    samples: np.ndarray,
    array: SensorArray,
    sonar: ActiveSonar,
    pulse: Waveform,
    table: SonarSection,
    targets: Targets,
    since: float,
    first: float,
    rate: float,
    rng: np.random.Generator,
) -> None:
    """Add the echoes of one ping, transmitted `first` seconds after the first of the samples."""
    states, there = states_of(targets, np.array([since]))
    if sonar.pair is None:
        raise InputError("sonar.source or sonar.receiver is missing; expected where they stand, to simulate.")
    delay, bearing = (np.asarray(part, float)[0] for part in sonar.pair.echo(states))
    shift = np.asarray(sonar.pair.doppler(states, pulse.frequency), float)[0]
    replica = np.sum(np.abs(pulse.value(np.arange(math.ceil(pulse.duration * rate)) / rate)) ** 2)
    # The module of the matched filter: half of the amplitude is at positive frequencies, channels add up to M.
    level = 2 * math.sqrt(10 ** (table.snr_db / 10) / array.alive.sum() / replica)
    time = np.arange(len(samples)) / rate
    for number in np.flatnonzero(there[0]):
        amplitude = level * complex(*rng.standard_normal(2)) / math.sqrt(2)
        arrives = first + delay[number] + array.delays(np.array(math.pi / 2 - bearing[number]))
        scale = 1 + shift[number] / pulse.frequency
        for channel, moment in enumerate(arrives):
            samples[:, channel] += np.real(amplitude * pulse.value(scale * (time - moment)))


def _reception(scenario: ReturnsScenario) -> tuple[SensorArray, ReceptionSection, SonarSection]:
    """What receives, of the one source and receiver."""
    if scenario.array is None or scenario.reception is None:
        lacking = "[reception]" if scenario.array is not None else "array"
        raise InputError(
            f"samples of hydrophones were given, and there is no {lacking}; expected an array (--array FILE), and "
            "[reception] with when pings are sent."
        )
    if len(scenario.pairs) != 1:
        raise InputError(
            f"samples of hydrophones are of one source and receiver; expected no more, not {len(scenario.pairs)} pairs."
        )
    return build(scenario.array), scenario.reception, next(iter(scenario.pairs.values()))


def _pulse(table: SonarSection) -> PulseSection:
    assert table.pulse is not None
    return table.pulse


def _require_band(pulse: Waveform, table: SonarSection, rate: float, source: str) -> None:
    """Refuse a pulse that the sample rate cannot hold."""
    highest = pulse.frequency + _pulse(table).bandwidth / 2
    if not highest < rate / 2:
        raise InputError(
            f"{source}: the pulse reaches {highest:g} Hz; expected below half of the sample rate, {rate / 2:g} Hz."
        )
