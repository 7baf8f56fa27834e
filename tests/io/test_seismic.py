"""miniSEED and SAC: time stamps rule, what is there counts once, and what is not there is missing."""

import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.io import read
from faintrack.io.clocks import interpolated, places

obspy = pytest.importorskip("obspy")
START = np.datetime64("2024-02-29T23:55:00", "ns")
RATE = 100.0


def trace(data, station="A", late=0.0, rate=RATE, **header):
    stats = {"station": station, "channel": "BDF", "network": "XX", "sampling_rate": rate}
    stats["starttime"] = obspy.UTCDateTime(str(START)) + late
    return obspy.Trace(np.asarray(data, np.int32), stats | header)


def write(path, *traces, **options):
    obspy.Stream(list(traces)).write(str(path), format="MSEED", **options)


def whole(recording):
    return recording.read(0, recording.length)


NOISE = np.random.default_rng(3).integers(-2000, 2000, (20_000, 3))


def wave(times):
    """Three tones below 0.4 of the sample rate, as a function of true time."""
    return sum(
        1e5 * np.sin(2 * np.pi * frequency * times + phase) for frequency, phase in ((3.1, 0.2), (11.7, 1), (31, 2))
    )


@pytest.mark.parametrize("ppm", [100, *(pytest.param(ppm, marks=pytest.mark.slow) for ppm in (-40, 10))])
def test_a_clock_that_drifts_is_followed(tmp_path, ppm):
    """Half an hour: up to 18 samples of drift. The first channel is true, the second is stamped rightly."""
    length, block = 180_000, 900  # each in a record of its own
    step = (1 + ppm * 1e-6) / RATE
    data = wave(np.arange(length) / RATE), wave(np.arange(length) * step)
    traces = [trace(data[0], "A")]
    traces += [trace(data[1][n : n + block], "B", n * step) for n in range(0, length, block)]
    write(tmp_path / "a.mseed", *traces, reclen=4096)
    recording = read(tmp_path / "a.mseed")
    samples = whole(recording)
    both = samples[100 : length - 100 - 20]
    # Stamps have microseconds, 1e-4 of a sample; a tone of 31 Hz then errs by 2 pi 0.31 1e-4 of its amplitude.
    np.testing.assert_allclose(both[:, 1], both[:, 0], atol=1e5 * 3 * 2e-3)
    (said,) = (remark for remark in recording.remarks if "by its time stamps" in remark)
    rate = float(said.split(" runs at ")[1].split(" Hz")[0])
    np.testing.assert_allclose(rate, 1 / step, rtol=2e-8)
    np.testing.assert_array_equal(recording.read(90_001, 90_500), samples[90_001:90_500])


def test_a_rate_that_is_a_little_off_nominal(tmp_path):
    length = 60_000
    times = np.arange(length) / RATE, np.arange(length) / (RATE * 1.0001)
    write(tmp_path / "a.mseed", trace(wave(times[0])), trace(wave(times[1]), "B", rate=RATE * 1.0001))
    samples = whole(read(tmp_path / "a.mseed"))[100 : length - 200]
    np.testing.assert_allclose(samples[:, 1], samples[:, 0], atol=1e5 * 3 * 2e-3)


def test_a_channel_that_starts_between_two_samples(tmp_path):
    times = np.arange(3000) / RATE
    write(tmp_path / "a.mseed", trace(wave(times)), trace(wave(times + 0.0042), "B", 0.0042))
    samples = whole(read(tmp_path / "a.mseed"))[50:-50]
    np.testing.assert_allclose(samples[:, 1], samples[:, 0], atol=1e5 * 3 * 2e-3)


def test_stamps_that_are_rounded_move_nothing(tmp_path):
    data = NOISE[:, 0]
    traces = [trace(data[n : n + 1000], late=n / RATE + 0.0003 * (-1) ** (n // 1000)) for n in range(0, 20_000, 1000)]
    write(tmp_path / "a.mseed", *traces)
    recording = read(tmp_path / "a.mseed")
    np.testing.assert_array_equal(whole(recording)[:, 0], data)
    assert recording.remarks == ()


def test_a_channel_that_ends_early_is_missing_from_then_on(tmp_path):
    write(tmp_path / "a.mseed", trace(NOISE[:, 0]), trace(NOISE[:, 1], "B"), trace(NOISE[:2000, 2], "C"), reclen=512)
    recording = read(tmp_path / "a.mseed")
    expected = NOISE.astype(np.float32)
    expected[2000:, 2] = np.nan
    np.testing.assert_array_equal(whole(recording), expected)
    assert recording.remarks == ("Channel XX.C..BDF has no samples in 180 s at the end; they are missing.",)
    assert recording.channel_names == ("A", "B", "C")


def test_sac_files_of_unequal_length(tmp_path):
    for station, column, length in (("A", 0, 20_000), ("B", 1, 20_000), ("C", 2, 2000)):
        trace(NOISE[:length, column], station).write(str(tmp_path / f"{station}.sac"), format="SAC")
    recording = read(*(tmp_path / f"{station}.sac" for station in "ABC"))
    expected = NOISE.astype(np.float32)
    expected[2000:, 2] = np.nan
    np.testing.assert_array_equal(whole(recording), expected)
    (remark,) = recording.remarks
    assert remark.endswith("C.sac has no samples in 180 s at the end; they are missing.")


@pytest.mark.parametrize("later_first", [False, True])
def test_overlaps_are_told_and_counted_once(tmp_path, later_first):
    first, second = trace(np.full(3000, 1)), trace(np.full(3000, 2), late=20.0)
    write(tmp_path / "a.mseed", *((second, first) if later_first else (first, second)))
    recording = read(tmp_path / "a.mseed")
    samples = whole(recording)[:, 0]
    assert recording.length == 5000
    assert set(samples[2000:3000]) == {1.0 if later_first else 2.0}
    assert recording.remarks == (
        "Channel XX.A..BDF: 1000 samples stand in the file more than once; those that come later in it count.",
    )


def test_records_that_stand_twice_in_a_file_count_once(tmp_path):
    write(tmp_path / "a.mseed", trace(NOISE[:, 0]), trace(NOISE[:, 1], "B"))
    content = (tmp_path / "a.mseed").read_bytes()
    (tmp_path / "b.mseed").write_bytes(content + content)
    recording = read(tmp_path / "b.mseed")
    np.testing.assert_array_equal(whole(recording), NOISE[:, :2])
    assert "20000 samples stand in the file more than once" in recording.remarks[0]


def test_gaps_are_told(tmp_path):
    write(tmp_path / "a.mseed", trace(NOISE[:400, 0]), trace(NOISE[600:, 0], late=6.0))
    recording = read(tmp_path / "a.mseed")
    assert np.isnan(whole(recording)[400:600]).all()
    assert recording.remarks == ("Channel XX.A..BDF: 2 s in 1 gaps are missing.",)


def test_channels_without_common_time(tmp_path):
    write(tmp_path / "a.mseed", trace(NOISE[:100, 0]), trace(NOISE[:100, 1], "B", 500.0))
    with pytest.raises(InputError, match=r"the channels XX\.A\.\.BDF, XX\.B\.\.BDF have no time in common"):
        read(tmp_path / "a.mseed")


def test_a_date_far_off_is_no_length(tmp_path):
    write(tmp_path / "a.mseed", trace(NOISE[:100, 0]), trace(NOISE[:100, 0], late=1e9))
    with pytest.raises(InputError, match="expected fewer gaps"):
        read(tmp_path / "a.mseed")


def test_sac_remarks(tmp_path):
    sac = pytest.importorskip("obspy.io.sac")
    sac.SACTrace(data=NOISE[:, 0].astype("f4"), delta=0.01, scale=1e-6).write(str(tmp_path / "a.sac"))
    with (tmp_path / "a.sac").open("ab") as file:
        file.write(bytes(8))
    recording = read(tmp_path / "a.sac")
    assert recording.length == len(NOISE)
    assert recording.remarks == (
        "The file holds 20002 samples, 2 more than its header tells; those are left out.",
        "The header tells a scale of 1e-06; samples are used as they stand.",
    )


class TestClocks:
    def test_interpolation_is_right_up_to_eight_tenths_of_the_band(self):
        wanted = np.arange(200, 800) + np.linspace(0, 1, 600)
        for share in (0.01, 0.3, 0.6, 0.8):
            samples = np.sin(np.pi * share * np.arange(1000) + 0.3)
            found = interpolated(lambda start, stop, samples=samples: samples[start:stop], 1000, wanted)
            np.testing.assert_allclose(found, np.sin(np.pi * share * wanted + 0.3), atol=1e-3)

    def test_whole_places_give_the_samples(self):
        found = interpolated(lambda start, stop: NOISE[start:stop, 0], 20_000, np.arange(0.0, 20_000.0))
        np.testing.assert_allclose(found, NOISE[:, 0], atol=1e-9)

    def test_stamps_that_bend_are_followed_from_stamp_to_stamp(self):
        numbers = np.arange(0, 10_000, 1000)
        stamps = numbers + 0.4 * np.abs(np.sin(numbers / 3000))
        run = places(numbers, stamps, 10_000, 1.0, 0.01)
        np.testing.assert_allclose([run.at(float(number)) for number in numbers], stamps)
        np.testing.assert_allclose(run.own(stamps), numbers)
        assert not run.plain
