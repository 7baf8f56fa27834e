"""Frames: what moves in them is found and followed, in blocks of any size, and what does not fit is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import faintrack as ft
from faintrack import Result, Sequence, from_frames
from faintrack.beliefs.axis import Axis
from faintrack.results.schema import joined

APPEARS, COUNT, SNR = 12, 40, 6.0
"""Frame in which the target appears; number of frames; its mean power over that of the noise in each, 7.8 dB."""
CLUTTER_SNR = 12.0
"""The same in clutter whose level has to be learned first, 10.8 dB."""
TIME = np.arange(COUNT)
PIXELS = {"frames": {"background": "none"}, "cells": {"amplitude": "rayleigh", "levels": [SNR]}}
PARTICLES = {"filter": {"kind": "particles", "particles": 4000, "births": 4000}}
PATH_X, PATH_Y = 3.0 + 0.6 * TIME, 18.0 - 0.3 * TIME
PATH_RANGE = 8.0 + 0.4 * TIME


def power(shape: tuple[int, ...], *path: np.ndarray, seed: int = 0, snr: float = SNR) -> np.ndarray:
    """Exponential power of mean 1, and of mean 1 + snr in the cell nearest to the path from APPEARS on."""
    mean = np.ones((COUNT, *shape))
    for frame in range(APPEARS, COUNT) if path else ():
        mean[(frame, *(round(float(along[frame])) for along in path))] += snr
    return mean * np.random.default_rng(seed).exponential(size=mean.shape)


def pixels(*path: np.ndarray, seed: int = 0) -> Sequence:
    """Images with Rayleigh's distribution, whose power is half the square."""
    return from_frames(np.sqrt(2 * power((20, 28), *path, seed=seed)))


@pytest.fixture(scope="module")
def result() -> Result:
    return ft.track(pixels(PATH_Y, PATH_X), PIXELS)


def test_a_faint_pixel_is_found_and_followed(result: Result) -> None:
    (track,) = result.tracks
    # Ten frames of 6 - log 7 nats each, if it were known where, against one of 560 pixels and a rate of 0.001.
    assert APPEARS < track.start_s <= APPEARS + 10
    assert track.end_s == COUNT - 1
    held = result.data.label.values[:, 0] > 0
    error = np.hypot(result.data.x[:, 0] - PATH_X, result.data.y[:, 0] - PATH_Y).values[held]
    # Half a pixel along each axis is what pixels tell at best; a fading target is lost for a frame or two.
    assert np.median(error) < 1.0
    assert error.max() < 4.0
    assert track.speed == pytest.approx(np.hypot(0.6, 0.3), abs=0.15)


def test_pixels_without_a_target_give_no_track() -> None:
    result = ft.track(pixels(seed=1), PIXELS)
    assert result.tracks == []
    assert result.data.existence.max() < 0.5


def test_blocks_of_any_size_give_the_same(result: Result) -> None:
    pieces = joined([moment.data for moment in ft.follow(pixels(PATH_Y, PATH_X), PIXELS, block=7)])
    xr.testing.assert_allclose(result.data.drop_dims("snapshot")[list(pieces)], pieces, rtol=1e-4, atol=1e-4)


def test_dark_targets_are_bright_ones_of_the_other_sign() -> None:
    frames = np.random.default_rng(5).normal(10.0, 1.0, (12, 16, 16)).astype(np.float32)
    frames[:, 8, 8] += 8.0
    tables = {"cells": {"amplitude": "gaussian", "width": 0.0}, "frames": {"memory": 5.0}}
    bright = ft.track(from_frames(frames), tables)
    dark = ft.track(from_frames(-frames), {**tables, "cells": {**tables["cells"], "dark": True}})
    for name in ("existence", "x", "y"):
        np.testing.assert_array_equal(bright.data[name], dark.data[name])
    # Pictures show what the file holds.
    np.testing.assert_array_equal(bright.data.frame, -dark.data.frame)


def test_some_frames_are_kept_for_the_report(result: Result) -> None:
    sequence, data = pixels(PATH_Y, PATH_X), result.data
    assert data.snapshot.values.tolist() == [4, 9, 14, 19, 24, 29, 34, 39]
    np.testing.assert_array_equal(data.frame[2], sequence.read(14, 15)[0].astype(np.float32))
    # The surface after a frame holds the odds of existence, spread over the cells.
    odds = np.exp(data.surface.values.astype(float)).sum(axis=(1, 2))
    existence = data.existence.sel(time=data.snapshot.values).values.astype(float)
    expected = np.sum(existence / (1 - np.minimum(existence, 1 - 1e-7)), axis=1)
    # Existence in single precision tells the odds of one in 4000 to a thousandth.
    np.testing.assert_allclose(odds, expected, rtol=5e-3)


@pytest.fixture(scope="module")
def profile() -> Sequence:
    """Range profiles whose clutter level differs from cell to cell; cells of 15 m, half a second apart."""
    level = np.random.default_rng(5).gamma(4.0, size=36)
    # Not every draw keeps one track: three faded frames in a row end it, and what the target leaves in a cell's level
    # hides it there until the level is known from more frames.
    frames = 40 * level * power((36,), PATH_RANGE, seed=4, snr=CLUTTER_SNR)
    return from_frames(frames, 100.0 + 0.5 * TIME, (("range", Axis(500.0, 15.0, 36)),))


def test_a_target_in_clutter_of_unknown_level_is_followed(profile: Sequence, tmp_path: Path) -> None:
    what = {"cells": {"levels": [CLUTTER_SNR]}}
    result = ft.track(profile, what, out=tmp_path / "out")
    (track,) = result.tracks
    assert 0.5 * APPEARS < track.start_s < 0.5 * APPEARS + 8
    assert track.mean["range"][-1] == pytest.approx(500 + 15 * PATH_RANGE[-1], abs=30)
    assert result.data.record.dims == result.data.surface.dims == ("time", "axis_range")
    assert (result.data.range.attrs["units"], result.data.range_rate.attrs["units"]) == ("m", "m/s")
    assert result.data.attrs["first_scan_time"] == 100.0
    assert result.summary()["realtime_factor"] > 0
    xr.testing.assert_allclose(result.data.load(), ft.track(profile, what).data, rtol=1e-3, atol=1e-3)


def doppler(first: float, leaves: int = COUNT) -> Sequence:
    """Power over 24 ranges and 11 rates, a fifth of a cell a frame apart; a target that goes 0.4 until it leaves."""
    axes = (("range", Axis(0.0, 1.0, 24)), ("range_rate", Axis(-1.0, 0.2, 11)))
    frames = power((24, 11), np.minimum(first + 0.4 * TIME, 23), np.full(COUNT, 7.0))
    frames[leaves:] = power((24, 11), seed=1)[leaves:]
    return from_frames(frames, None, axes)


DOPPLER = {"frames": {"background": "none"}, "cells": {"amplitude": "swerling1", "levels": [SNR]}}


@pytest.mark.slow
def test_particles_follow_where_a_doppler_axis_says_the_rate() -> None:
    result = ft.track(doppler(2.0), DOPPLER | PARTICLES)
    (track,) = result.tracks
    assert track.mean["range"][-1] == pytest.approx(2.0 + 0.4 * (COUNT - 1), abs=2)
    assert float(result.data.range_rate[-1, 0]) == pytest.approx(0.4, abs=0.15)


def test_a_track_ends_where_its_target_leaves_the_frame() -> None:
    leaves = 28
    result = ft.track(doppler(23.4 - 0.4 * leaves, leaves), DOPPLER | PARTICLES)
    (track,) = result.tracks
    # One that has left the last cell may be silent in it, for ten scans about.
    assert leaves - 4 < track.end_s < leaves + 12
    assert track.mean["range"].max() <= 23.5


IMAGES, PROFILES = from_frames(np.ones((4, 12, 12))), from_frames(np.ones((4, 12)))


@pytest.mark.parametrize(
    ("sequence", "tables", "says"),
    [
        (PROFILES, {"frames": {"background": "whiten"}}, r"shape \(12,\); expected two axes"),
        (from_frames(np.ones((4, 4, 30))), {}, r"shape \(4, 30\); expected two axes with more than 4"),
        (IMAGES, {"frames": {"memory": 2.0}}, "memory is 2; expected 0, or more than 3"),
        (PROFILES, {"frames": {"memory": 0.5}}, "memory is 0.5; expected at least 1"),
        (IMAGES, {"frames": {"background": "none"}}, "amplitude is missing; expected one of gaussian"),
        (IMAGES, {"cells": {"amplitude": "rayleigh"}}, "amplitude is rayleigh; expected gaussian or student"),
        (PROFILES, {"cells": {"width": 1.0}}, "no amplitude or width"),
        (PROFILES, {"cells": {"dark": True}}, "dark: values are a power"),
        (PROFILES, {"cells": {"levels": [1.0, 2.0]}}, "levels with one number"),
        (from_frames(np.ones((2, 600, 600))), {"filter": {"speeds": 9}}, "600 x 600 x 9 x 9 cells"),
        (
            from_frames(np.ones((2, 9, 9)), None, (("range", Axis(0.0, 1.0, 9)), ("bearing", Axis(0.0, 1.0, 9)))),
            {},
            "axes range, bearing; expected y and x, range",
        ),
        (from_frames(-np.ones((3, 12))), {}, "frame 0 holds values below 0"),
        (from_frames(np.ones((4, 12, 12)), 1e-300 * np.arange(4)), {}, "1e-300 s apart; expected at least 1e-09 s"),
        (IMAGES, {"target": {"speed": 1e9}}, r"1e\+09 cells of x between two frames, .* expected a lower target.speed"),
        (IMAGES, {"target": {"velocity_noise": 1e9}}, "expected a lower target.speed or target.velocity_noise"),
    ],
)
def test_what_does_not_fit_is_refused(sequence: Sequence, tables: dict[str, Any], says: str) -> None:
    with pytest.raises(ft.InputError, match=says):
        ft.track(sequence, tables)
