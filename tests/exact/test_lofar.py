"""LOFAR and DEMON: levels of tones and of modulated noise, worked out by hand, and what noise alone shows."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from faintrack.data.recording import Recording, from_samples
from faintrack.errors import InputError
from faintrack.signal.demon import demon, envelope
from faintrack.signal.lofar import Line, Lofargram, harmonics, lofar, rows_of

RATE, SECONDS = 1000.0, 100.0
TIME = np.arange(int(RATE * SECONDS)) / RATE


def noise(seed: int, channels: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(len(TIME), channels))


def modulated(rate: float, depth: float, seed: int) -> Recording:
    return from_samples(noise(seed) * (1 + depth * np.cos(2 * np.pi * rate * TIME))[:, None], RATE)


def test_power_in_white_noise_is_its_variance_and_rows_stand_in_their_middle() -> None:
    rows = list(rows_of([3.0 * noise(0, 2)], RATE, 200, 100))
    assert [row.windows for row in rows[:-1]] == [100] * (len(rows) - 1)
    # Half of 101 steps of a tenth of a second.
    assert rows[0].time == pytest.approx((99 * 0.1 + 0.2) / 2)
    power = np.mean([row.power[2:-2] for row in rows[:-1]], axis=0)
    windows = 2 * 100 * (len(rows) - 1) / (1 + 2 / 36)
    assert abs(power.mean() / 9 - 1) < 5 / np.sqrt(windows * len(power))
    # Of K windows that are as good as independent a bin deviates by 1 over the root of K.
    assert power.std() / 9 == pytest.approx(1 / np.sqrt(windows), rel=0.3)


@pytest.mark.parametrize("amplitude", [0.1, 0.3])
def test_level_of_a_tone(amplitude: float) -> None:
    """On a bin, a window of Hann gives a^2 N / 6 over the noise's variance, and 1 for the noise."""
    record = lofar(from_samples(noise(1) + amplitude * np.sin(2 * np.pi * 200.0 * TIME)[:, None], RATE), resolution=1.0)
    (line,) = record.lines
    assert abs(line.frequency - 200.0) < 0.1
    expected = amplitude**2 * 1000 / 6 + 1
    # The mean of 199 windows, and a tone that beats with the noise: variance 1 + 2 a^2 N / 6 of each.
    deviation = np.sqrt((1 + 2 * (expected - 1)) * (1 + 2 / 36) / 199) / expected
    assert abs(10 ** (line.level_db / 10) / expected - 1) < 5 * deviation
    assert record.level_db.shape == (len(record.times), len(record.frequency))


def test_a_tone_between_bins_is_placed() -> None:
    record = lofar(from_samples(noise(2) + 0.3 * np.sin(2 * np.pi * 123.37 * TIME)[:, None], RATE), resolution=1.0)
    assert [round(line.frequency, 1) for line in record.lines] == [123.4]


def test_noise_alone_shows_a_line_as_seldom_as_is_said() -> None:
    """One record in a hundred; of a hundred records, five at most, the chance of more is 0.0006. Colour is no line."""
    shown = 0
    for seed in range(100):
        white = np.random.default_rng(seed).normal(size=20_000)
        colored = white + 0.8 * np.roll(white, 1)
        shown += bool(lofar(from_samples(colored[:, None], RATE), (10.0, 450.0), resolution=2.0).lines)
    assert shown <= 5


@pytest.mark.parametrize(("rate", "depth"), [(7.0, 0.3), (12.4, 0.2)])
def test_modulation_shows_at_its_rate_and_nowhere_in_the_spectrum(rate: float, depth: float) -> None:
    recording = modulated(rate, depth, seed=3)
    # A band of 310 Hz: powers of a tenth of a second are known to a sixth.
    record = demon(recording, (120.0, 430.0), highest=50.0, resolution=0.2)
    assert abs(record.lines[0].frequency - rate) < 0.05
    assert all(min(abs(line.frequency - n * rate) for n in (1, 2)) < 0.1 for line in record.lines)
    assert lofar(recording, resolution=1.0).lines == ()
    assert demon(from_samples(noise(4), RATE), (120.0, 430.0), highest=50.0, resolution=0.2).lines == ()


def test_depth_of_modulation_by_the_power_of_its_line() -> None:
    """The envelope over its mean has the amplitude 2 m / (1 + m^2 / 2) at the rate of the modulation."""
    depth, rate, every = 0.3, 7.0, 8
    power = np.concatenate(
        list(
            envelope(
                [noise(5) * 1.0 * (1 + depth * np.cos(2 * np.pi * rate * TIME))[:, None]], RATE, (120.0, 430.0), every
            )
        )
    )[200:, 0]
    time = TIME[::every][200 : 200 + len(power)]
    amplitude = 2 * abs(np.mean((power / power.mean() - 1) * np.exp(-2j * np.pi * rate * time)))
    # A band of 310 Hz has 31,000 independent powers in 100 s.
    assert abs(amplitude - 2 * depth / (1 + depth**2 / 2)) < 5 * np.sqrt(2 / 31_000)


def test_shaft_and_blades_are_one_series() -> None:
    pulses = sum(level * np.cos(2 * np.pi * 2.5 * n * TIME) for n, level in ((1, 0.15), (2, 0.15), (3, 0.15), (4, 0.3)))
    record = demon(from_samples(noise(6) * (1 + pulses)[:, None], RATE), (120.0, 430.0), highest=50.0, resolution=0.2)
    own = [line for line in record.lines if line.fundamental is not None]
    assert {1, 2, 3, 4} <= {line.harmonic for line in own}
    assert all(abs(line.fundamental - 2.5) < 0.01 for line in own if line.fundamental is not None)
    loudest = max(record.lines, key=lambda line: line.level_db)
    assert loudest.harmonic == 4


def test_lines_that_fit_no_series_stay_alone() -> None:
    places = (50.0, 73.1, 100.0, 118.9, 150.02)
    found = harmonics([Line(place, 10.0) for place in places], 0.2)
    assert [line.harmonic for line in found] == [1, 0, 2, 0, 3]
    assert all(line.fundamental is None for line in harmonics([Line(31.0, 9.0), Line(44.4, 9.0)], 0.2))


def test_memory_does_not_grow_with_the_recording() -> None:
    """What is read at once is a window or a second, and the cut into blocks changes nothing."""
    spans: list[int] = []
    whole = noise(7) + 0.3 * np.sin(2 * np.pi * 60.0 * TIME)[:, None]

    def read(start: int, stop: int) -> np.ndarray:
        spans.append(stop - start)
        return whole[start:stop]

    recording = Recording(read, len(whole), RATE, ("0",))
    records = lofar(recording, resolution=0.5), demon(recording, (120.0, 430.0), 50.0)
    assert max(spans) <= 2000
    assert all(len(record.times) <= 601 for record in records)

    def cut(sizes: Iterator[int]) -> Iterator[np.ndarray]:
        start = 0
        while start < len(whole):
            size = next(sizes)
            yield whole[start : start + size]
            start += size

    rng = np.random.default_rng(0)
    pieces = rows_of(cut(iter(lambda: int(rng.integers(1, 5000)), 0)), RATE, 2000, 7)
    for one, other in zip(rows_of([whole], RATE, 2000, 7), pieces, strict=True):
        np.testing.assert_allclose(one.power, other.power)
        assert one.time == other.time


def test_what_is_no_number_is_nothing() -> None:
    samples = noise(8)
    samples[500:700] = np.nan
    record = lofar(from_samples(samples, RATE), resolution=1.0)
    assert np.isfinite(record.level_db).all()
    assert record.lines == ()


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (
            lambda recording: lofar(recording, (0.0, 600.0)),
            "the band goes from 0 to 600 Hz; expected the lower end first",
        ),
        (lambda recording: lofar(recording, resolution=0.001), "lasts 100 s; expected a window of 1000 s at least"),
        (lambda recording: lofar(recording, channels=[1]), "there is no channel 1; expected 0 to 0"),
        (lambda recording: demon(recording, (0.0, 400.0)), "the band goes from 0 to 400 Hz; expected the lower end"),
        (lambda recording: demon(recording, (30.0, 400.0)), "rates up to 100 Hz are looked for in a band from 30"),
        (lambda recording: demon(recording, channels=[4]), "there is no channel 4; expected 0 to 0"),
        (lambda recording: demon(recording, resolution=0.001), "expected a window of 1000 s at least"),
        (lambda recording: lofar(recording, resolution=0.0), "resolution is 0 Hz; expected more than 0"),
        (lambda recording: demon(recording, interval=-1.0), "interval is -1 s; expected more than 0"),
        (lambda recording: lofar(recording, (100.0, 103.0), resolution=1.0), "holds 4 bins of 1 Hz; expected 29"),
    ],
)
def test_what_cannot_be_is_refused(call, says: str) -> None:
    with pytest.raises(InputError, match=says):
        call(from_samples(noise(0), RATE))


def falling(power: float) -> np.ndarray:
    """Noise whose amplitude falls with that power of the frequency."""
    frequency = np.fft.rfftfreq(len(TIME), 1 / RATE)
    return np.fft.irfft(np.fft.rfft(noise(7)[:, 0]) / np.maximum(frequency, 2.0) ** power, len(TIME))[:, None]


def loud_for_two_seconds() -> np.ndarray:
    samples = noise(8)
    samples[40_000:42_000] *= 30.0
    return samples


@pytest.mark.parametrize("record", [lofar, demon])
@pytest.mark.parametrize(
    "samples",
    [falling(1.0), falling(2.0), loud_for_two_seconds(), np.zeros((len(TIME), 1)), np.full((len(TIME), 1), 3.0)],
    ids=["falls", "falls twice as fast", "a burst", "silence", "a constant"],
)
def test_what_has_no_line_shows_none(record: Callable[[Recording], Lofargram], samples: np.ndarray) -> None:
    assert record(from_samples(samples, RATE)).lines == ()


@pytest.mark.parametrize("record", [lofar, demon])
def test_what_is_missing_is_told(record: Callable[[Recording], Lofargram]) -> None:
    samples = noise(9, 2)
    samples[30_000:40_000, 1] = np.nan
    (said,) = record(from_samples(samples, RATE)).remarks
    assert said.startswith("10000 of 200000 samples (5 %) are missing")
