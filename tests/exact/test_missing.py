"""The gate for values: what is missing, why, and nothing else."""

import numpy as np
import pytest

from faintrack.data.missing import (
    CONSTANT_RUN,
    REASONS,
    SENTINELS,
    Missing,
    Span,
    gate,
    gate_frames,
    gated,
    level,
    run_lengths,
)
from faintrack.data.recording import from_samples

NOISE = np.random.default_rng(5).normal(size=(1000, 3))


def spoilt(value, start=200, stop=220, channel=1, samples=NOISE):
    samples = samples.copy()
    samples[start:stop, channel] = value
    return samples


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (np.nan, "not finite"),
        (np.inf, "not finite"),
        (-np.inf, "not finite"),
        (1e20, "fill value"),
        (9.97e36, "too large"),
        (9.969209968386869e36, "fill value"),
        (3e17, "too large"),
        (-1e19, "too large"),
        *((value, "sentinel") for value in SENTINELS),
    ],
)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_each_mark_of_what_was_not_measured(value, reason, dtype):
    samples = spoilt(value).astype(dtype)
    clean, missing = gate(samples)
    assert clean.dtype == dtype
    expected = samples.copy()
    expected[200:220, 1] = np.nan
    np.testing.assert_array_equal(clean, expected)
    assert {name: count.tolist() for name, count in missing.counts.items()} == {reason: [0, 20, 0]}
    assert missing.spans == (Span(reason, 1, 200, 220),)
    assert missing.total.tolist() == [0, 20, 0]


@pytest.mark.parametrize("value", [1e17, 1e20, 9.97e36, 1e38, np.inf])
def test_one_sample_is_enough(value):
    clean, _ = gate(spoilt(value, 500, 501).astype(np.float32))
    assert np.argwhere(np.isnan(clean)).tolist() == [[500, 1]]


def test_a_sentinel_alone_is_a_sample():
    samples = spoilt(-9999.0, 500, 503)
    np.testing.assert_array_equal(gate(samples)[0], samples)


@pytest.mark.parametrize("dtype", [np.int16, np.int32, np.uint8, ">i2"])
def test_whole_numbers(dtype):
    samples = np.random.default_rng(3).integers(0, 100, (500, 2)).astype(dtype)
    clean, missing = gate(samples)
    np.testing.assert_array_equal(clean, samples)
    assert clean.dtype == np.float32
    assert not missing.counts


def test_the_lowest_number_of_32_bits_held():
    samples = np.random.default_rng(3).integers(-100, 100, (500, 2)).astype(np.int32)
    samples[10:30, 0] = np.iinfo(np.int32).min
    assert gate(samples)[1].spans == (Span("sentinel", 0, 10, 30),)


def test_masked_samples_whatever_stands_beneath():
    samples = np.ma.masked_array(NOISE.copy(), mask=False)
    samples[5:9, 2] = np.ma.masked
    clean, missing = gate(samples)
    assert np.isnan(clean[5:9, 2]).all()
    assert missing.spans == (Span("masked", 2, 5, 9),)
    np.testing.assert_array_equal(np.ma.getdata(samples), NOISE)  # the input is left as it is


def test_constant_stretches_count_from_their_length_on():
    short, long = (gate(spoilt(0.25, 100, 100 + length))[1] for length in (CONSTANT_RUN - 1, CONSTANT_RUN))
    assert not short.counts
    assert long.spans == (Span("constant", 1, 100, 100 + CONSTANT_RUN),)
    assert not gate(spoilt(0.25, 100, 900), constant_run=None)[1].counts


def test_digital_silence_is_missing():
    clean, missing = gate(np.zeros((500, 4)))
    assert np.isnan(clean).all()
    assert missing.counts["constant"].tolist() == [500] * 4


def test_clipping_is_counted_and_stays():
    samples = NOISE * 0.1
    samples[40:45, 0] = 1.0
    clean, missing = gate(samples)
    np.testing.assert_array_equal(clean, samples)
    assert missing.clipped[0] == 5
    assert missing.sentences("abc") == ("Channel a: 5 samples stand at full scale; they were used.",)


@pytest.mark.parametrize("unit", [1e-30, 1e-20, 1e-9, 1.0, 1e9, 1e20, 1e30])
def test_the_unit_changes_nothing(unit):
    """Scaled by their level, samples of any unit are the same, and one that is far beyond it is missing in all."""
    factor = 2.0 ** round(np.log2(unit))
    samples = (NOISE * factor).astype(np.float32)
    samples[7, 1] = 1e16 * factor if unit <= 1e20 else np.inf
    clean, missing = gate(samples)
    assert np.argwhere(np.isnan(clean)).tolist() == [[7, 1]]
    scaled = clean / np.float32(level(samples))
    np.testing.assert_array_equal(scaled, gate(NOISE.astype(np.float32))[0] / level(NOISE) + 0 * scaled)
    assert np.isfinite(np.nansum(np.float32(scaled) ** 2))
    assert missing.total.sum() == 1


def test_level_is_a_power_of_two_near_the_samples():
    for factor in (1e-30, 3e-4, 1.0, 7e12):
        found = level(NOISE * factor)
        assert np.frexp(found)[0] == 0.5
        assert 0.25 < found / factor < 2
    assert level(np.full(3, np.nan)) == level(np.zeros(0)) == 1.0
    assert level(spoilt(1e21, 0, 900)) <= 2 * level(NOISE)


def test_reports_of_blocks_add_up():
    samples = spoilt(np.nan, 190, 230)
    samples[950:, 0] = np.inf
    whole = gate(samples)[1]
    parts = Missing(0, {}, np.zeros(3, int))
    for start in range(0, 1000, 70):
        parts = parts + gate(samples[start : start + 70])[1]
    assert parts.length == whole.length == 1000
    assert set(parts.spans) == set(whole.spans)
    assert parts.total.tolist() == whole.total.tolist() == [50, 40, 0]


def test_blocks_of_a_recording_make_the_whole():
    samples = spoilt(-9999.0, 300, 320)
    samples[500:600, 2] = samples[500, 2]
    recording = from_samples(samples, 100.0)
    whole = gated(recording).read(0, 1000)[0]
    assert np.isnan(whole).sum() == 120
    held = gated(recording)
    for size in (1, 7, 64, 333):
        blocks = [held.read(start, min(start + size, 1000))[0] for start in range(290, 620, size)]
        joined = np.concatenate(blocks)
        np.testing.assert_array_equal(joined, whole[290 : 290 + len(joined)])


def test_the_level_of_a_recording_that_begins_with_silence():
    samples = NOISE * 1e-7
    samples[:400] = 0.0
    assert gated(from_samples(samples, 10.0), seconds=10.0).level == level(NOISE * 1e-7)


def test_frames_miss_cells_and_keep_what_does_not_change():
    frames = np.tile(np.arange(30.0).reshape(5, 6), (8, 1, 1))
    frames[2, 1:5, 3] = -9999.0  # a column of four
    frames[4:8, 0, 0] = 32767.0  # four frames on end
    frames[6, 4, 4] = np.nan
    clean, missing = gate_frames(frames)
    assert np.isnan(clean).sum() == 9
    assert missing.counts["sentinel"].sum() == 8
    assert missing.counts["sentinel"].shape == (5, 6)
    assert missing.counts["not finite"][4, 4] == 1
    assert missing.spans == (
        Span("not finite", None, 6, 7),
        Span("sentinel", None, 2, 3),
        Span("sentinel", None, 4, 8),
    )


def test_run_lengths_of_each_axis():
    values = np.array([[1, 1, 2], [1, 3, 2]])
    assert run_lengths(values).tolist() == [[2, 1, 2], [2, 1, 2]]
    assert run_lengths(values, 1).tolist() == [[2, 2, 1], [1, 1, 1]]


def test_every_reason_has_a_sentence():
    samples = spoilt(np.nan, 100, 150)
    (sentence,) = gate(samples)[1].sentences(("a", "b", "c"), 50.0)
    assert sentence == "Channel b: 50 samples from 2 s to 3 s are missing (not finite)."
    assert "not finite" in REASONS
    assert gate_frames(samples[:, :, None])[1].sentences() == (
        "Frames: 50 cells from 100 s to 150 s are missing (not finite).",
    )
