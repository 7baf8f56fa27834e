"""Frame by frame equals all at once, and what a recording holds is told."""

from pathlib import Path

import numpy as np
import pytest

import faintrack as ft
from faintrack import Recording, from_samples, line_array, sensor_array
from faintrack.kinds import kind_named
from faintrack.signal.array_background import isotropic
from faintrack.simulation.samples import Source, draw_samples

ARRAY = line_array(8, 0.75)
RATE = 1000.0


def recording(*sources: Source, duration: float = 20.0) -> Recording:
    return from_samples(np.concatenate(list(draw_samples(ARRAY, sources, duration, RATE))), RATE)


@pytest.mark.slow
def test_following_equals_tracking() -> None:
    heard = recording(Source(-5.0, 1.0, start=5.0))
    moments, result = list(ft.follow(heard, array=ARRAY)), ft.track(heard, array=ARRAY)
    assert [moment.time for moment in moments] == result.data.time.values.tolist()
    existence = [moment.existence for moment in moments]
    # One frame a block or many: the beam products are summed in another order, and the particles drift apart by
    # rounding.
    np.testing.assert_allclose(existence, result.data.existence.max("slot"), atol=1e-2)
    assert moments[-1].checkpoint.state[1].sought.log_weights.shape == (1250,)
    assert moments[-1].data.record.shape == (
        1,
        result.data.sizes["beam"],
    )


@pytest.mark.slow
def test_a_source_that_takes_over_begins_a_new_track() -> None:
    heard = recording(Source(0.0, 0.8, end=10.0), Source(0.0, 2.2, start=10.0))
    result = ft.track(heard, array=ARRAY)
    first, second = result.tracks
    assert (first.label, second.label) == (1, 2)
    assert abs(first.average("bearing") - np.degrees(0.8)) < 2
    assert abs(second.average("bearing") - np.degrees(2.2)) < 2
    # A source that is not heard any more may be heard again within ten scans.
    assert 9 < first.end_s < 20
    assert second.start_s < 13


def test_two_sources_at_once_have_a_label_each() -> None:
    result = ft.track(recording(Source(0.0, 0.8), Source(-15.0, 2.2)), array=ARRAY)
    assert sorted(round(np.radians(track.average("bearing")), 1) for track in result.tracks) == [0.8, 2.2]
    # The loud one in its first frame; the faint one stays to the end as well.
    assert max(track.start_s for track in result.tracks) < 10
    assert all(track.end_s == result.data.time[-1] for track in result.tracks)
    assert np.all(result.data.label[:, -1] == 0)


@pytest.mark.parametrize("level", [20.0, 40.0])
def test_a_loud_source_has_one_label_from_its_first_frame_on(level: float) -> None:
    result = ft.track(recording(Source(level, 0.8)), array=ARRAY)
    (only,) = result.tracks
    assert (only.start_s, only.end_s) == (result.data.time[0], result.data.time[-1])
    bearing = np.asarray(result.data.bearing)[np.asarray(result.data.label) == 1]
    np.testing.assert_allclose(np.radians(bearing), 0.8, atol=2e-3)
    assert result.remarks == ("The SNR of target 1 is at the upper end of target.snr_db, 20 dB, or beyond it.",)


@pytest.mark.slow
def test_a_target_for_which_there_is_no_room_is_told() -> None:
    two = recording(Source(0.0, 0.8), Source(0.0, 2.2), Source(0.0, 1.5), duration=5.0)
    result = ft.track(two, array=ARRAY, tracker={"targets": 2})
    assert len(result.tracks) == 2
    assert result.summary()["full_scans"] > 0
    assert any("one more target was found than the 2" in remark for remark in result.remarks)
    assert result.scenario.tracker.targets == 2


def test_a_likelihood_of_one_target_says_so() -> None:
    result = ft.track(
        recording(Source(0.0, 0.8), duration=5.0), array=ARRAY, likelihood={"kind": "known_noise", "noise_power": 1.0}
    )
    assert result.scenario.tracker.targets == 1
    assert any("knows of one target" in remark for remark in result.remarks)


@pytest.mark.parametrize(
    ("sources", "factor", "says"),
    [
        ([Source(0.0, 0.8)], 1.0, "Channels agree"),
        ([Source(0.0, 0.8)], -1.0, "Channel 3 seems to have its poles reversed"),
        ([], 1.0, "No source is heard"),
    ],
)
def test_a_close_look_tells_right_channels_from_wrong_and_from_nothing(
    sources: list[Source], factor: float, says: str, tmp_path: Path
) -> None:
    samples = np.concatenate(list(draw_samples(ARRAY, sources, 8.0, RATE)))
    samples[:, 3] *= factor
    file = tmp_path / "night.h5"
    kind_named("recording").write(file, from_samples(samples, RATE))
    assert ft.info(file, array=ARRAY, check=True).remarks[-1].startswith(says)


def test_what_cannot_be_looked_at_is_an_error(tmp_path: Path) -> None:
    file = tmp_path / "night.h5"
    kind_named("recording").write(file, recording(duration=2.0))
    with pytest.raises(ft.InputError, match="a check needs --array FILE"):
        ft.info(file, check=True)
    with pytest.raises(ft.InputError, match="allows at most 500 Hz"):
        ft.info(file, array=ARRAY, analysis={"band": [10.0, 900.0]}, check=True)
    frames = tmp_path / "frames.npz"
    kind_named("frames").write(frames, ft.from_frames(np.zeros((4, 12, 12))))
    with pytest.raises(ft.InputError, match="nothing to check"):
        ft.info(frames, check=True)


@pytest.mark.slow
def test_noise_from_all_directions_is_no_source() -> None:
    """Half of the noise arrives from everywhere; with channels taken for independent it is a track to the end."""
    rng, seconds = np.random.default_rng(2), 20
    frequency = np.fft.rfftfreq(int(RATE), 1 / RATE)
    root = np.linalg.cholesky(isotropic(ARRAY, frequency) + 1e-3 * np.eye(len(ARRAY.gains)))
    white = rng.normal(size=(seconds, 2, len(frequency), len(ARRAY.gains)))
    spectra = np.einsum("fij,tfj->tfi", root, white[:, 0] + 1j * white[:, 1])
    around = np.fft.irfft(spectra, int(RATE), axis=1).reshape(-1, len(ARRAY.gains))
    samples = around / around.std() + rng.normal(size=around.shape)
    heard = from_samples(samples, RATE)
    assert ft.track(heard, array=ARRAY).tracks == []
    assert ft.track(heard, array=ARRAY, likelihood={"isotropic": False}).tracks


def test_a_source_that_comes_back_is_a_new_track() -> None:
    heard = recording(Source(0.0, 0.8, end=8.0), Source(0.0, 0.8, start=30.0, end=38.0), duration=40.0)
    assert [track.label for track in ft.track(heard, array=ARRAY).tracks] == [1, 2]


def test_samples_that_are_not_finite_hurt_their_frame_alone() -> None:
    samples = np.concatenate(list(draw_samples(ARRAY, [Source(0.0, 1.0)], 10.0, RATE)))
    holes = samples.copy()
    holes[4500, 2] = np.nan
    whole, holed = (ft.track(from_samples(s, RATE), array=ARRAY) for s in (samples, holes))
    assert holed.data.masked_channels.values.tolist() == [0, 0, 0, 0, 1, 0, 0, 0, 0, 0]
    (of_whole,), (of_holed,) = whole.tracks, holed.tracks
    assert np.abs(of_whole.mean["bearing"] - of_holed.mean["bearing"]).max() < 1.0
    assert np.isfinite(holed.data.record).all()


def test_a_frame_of_zeros_says_nothing() -> None:
    samples = np.concatenate(list(draw_samples(ARRAY, [], 10.0, RATE)))
    samples[3000:6000] = 0
    result = ft.track(from_samples(samples, RATE), array=ARRAY)
    np.testing.assert_allclose(result.data.log_evidence[3:6], 0, atol=1e-5)


def test_dead_and_inverted_channels_are_left_out_and_corrected() -> None:
    clean = recording(Source(0.0, 1.0), duration=10.0)
    samples = clean.read(0, clean.length).copy()
    samples[:, 2] = 1e3 * np.sin(np.arange(len(samples)))
    samples[:, 5] *= -1
    gains = np.ones(8)
    gains[[2, 5]] = 0, -1
    array = sensor_array(ARRAY.positions, gains=gains)
    (found,) = ft.track(from_samples(samples, RATE), array=array).tracks
    assert abs(found.average("bearing") - np.degrees(1.0)) < 1


def test_noise_power_is_measured_from_the_first_seconds() -> None:
    samples = 3 * np.concatenate(list(draw_samples(ARRAY, [Source(-5.0, 1.0, start=10.0)], 20.0, RATE)))
    known = {"kind": "known_noise", "noise_seconds": 8.0}
    (found,) = ft.track(from_samples(samples, RATE), array=ARRAY, likelihood=known).tracks
    assert 9 < found.start_s < 14
    assert abs(found.average("bearing") - np.degrees(1.0)) < 2


def test_channels_must_agree() -> None:
    with pytest.raises(ft.InputError, match="has 8 channels; the array has 4"):
        ft.track(recording(duration=2.0), array=line_array(4, 1.0))
