"""Active sonar from the samples of its hydrophones: matched filter and normaliser, and a scene through all of it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats
from typer.testing import CliRunner

import faintrack as ft
from faintrack.cli.app import app
from faintrack.errors import InputError
from faintrack.io import write_recording
from faintrack.kinds.returns.hydrophones import returns_of
from faintrack.sensors.array import line_array
from faintrack.signal.matched_filter import Waveform, coded, matched, recorded, split_window, sweep

RATE = 1000.0
BARKER = (1, 1, 1, 1, 1, -1, -1, 1, 1, -1, 1, -1, 1)
SQUARE = {"channels": [{"name": f"{i}{j}", "x": 3.2 * i, "y": 3.2 * j} for i in range(4) for j in range(4)]}
"""Sixteen hydrophones half a wave apart at 234 Hz: zeros of a beam 36 degrees from its middle."""

SECTIONS: dict[str, Any] = {
    "kind": "returns",
    "sonar": {
        "pulse": {"frequency": 200.0, "duration": 0.5, "bandwidth": 50.0},
        "delay": (1.0, 5.0),
        "delay_step": 0.02,
        "beams": 12,
        "beam_width_deg": 11.4,
        "source": (0.0, 0.0),
        "receiver": (0.0, 0.0),
        "threshold_db": 9.0,
        "snr_db": 15.0,
    },
    "reception": {"interval": 10.0, "sample_rate": RATE},
    "grid": {"x": (-3600.0, 3600.0), "y": (-3600.0, 3600.0), "cells": (18, 18), "speed": 9.0, "speeds": 7},
    "simulation": {"pings": 24, "interval": 10.0, "targets": [{"x": 1800.0, "y": 1200.0, "vx": -5.0, "vy": -3.0}]},
}


def scenario(**changes: Any) -> ft.Scenario:
    return ft.Scenario(**{**SECTIONS, "array": SQUARE, **changes})


def replica_file(folder: Path) -> Waveform:
    time = np.arange(400) / RATE
    samples = np.cos(2 * np.pi * (180 * time + 30 * time**2)) * np.hanning(400)
    return recorded(samples, RATE, 192.0)


@pytest.mark.parametrize("doppler", [0.0, 3.0])
@pytest.mark.parametrize("form", ["cw", "linear", "hyperbolic", "coded", "file"])
def test_output_is_that_of_a_direct_sum(form: str, doppler: float, tmp_path: Path) -> None:
    pulse = {
        "cw": sweep(200.0, 0.3),
        "linear": sweep(200.0, 0.3, 80.0),
        "hyperbolic": sweep(200.0, 0.3, 80.0, hyperbolic=True),
        "coded": coded(200.0, 0.26, BARKER),
        "file": replica_file(tmp_path),
    }[form]
    taps = pulse.samples(RATE, doppler)
    samples = np.random.default_rng(0).normal(size=(900, 1))
    array = line_array(2, 1e-3)
    (output,) = matched(np.repeat(samples, 2, axis=1), array, np.array([np.pi / 2]), [taps], RATE)
    direct = [np.sum(samples[k : k + len(taps), 0] * np.conj(taps)) for k in range(len(samples) - len(taps) + 1)]
    np.testing.assert_allclose(output[0], direct, atol=1e-4 * np.abs(direct).max())


def test_sweeps_run_through_their_band_and_keep_their_module() -> None:
    time = np.linspace(0, 0.3, 3001)[:-1]
    for pulse, middle in ((sweep(200.0, 0.3, 80.0), 200.0), (sweep(200.0, 0.3, 80.0, True), 2 * 160 * 240 / 400)):
        phase = np.unwrap(np.angle(pulse.value(time)))
        frequency = np.gradient(phase, time) / (2 * np.pi)
        np.testing.assert_allclose(frequency[[5, 1500, -5]], [160, middle, 240], atol=0.5)
        np.testing.assert_allclose(np.abs(pulse.value(time)), 1)


def test_a_wave_is_found_in_its_beam_at_its_delay_with_the_gain_of_the_channels() -> None:
    array, pulse = line_array(8, 3.5), sweep(200.0, 0.5, 50.0)
    bearings = np.radians([30.0, 60.0, 90.0, 120.0])
    arrives = 0.7 + array.delays(np.array(bearings[1]))
    time = np.arange(2000) / RATE
    samples = np.stack([pulse.value(time - moment).real for moment in arrives], axis=1)
    outputs = np.abs([beam[0] for beam in matched(samples, array, bearings, [pulse.samples(RATE)], RATE)])
    beam, sample = np.unravel_index(outputs.argmax(), outputs.shape)
    assert (int(beam), int(sample)) == (1, 700)
    # Half of a real wave is at positive frequencies, and its replica has the energy of 500 samples.
    np.testing.assert_allclose(outputs.max(), 0.5 * np.sqrt(500), rtol=0.01)


def test_a_normaliser_leaves_the_tail_that_is_told() -> None:
    power = 7.0 * np.random.default_rng(0).exponential(size=(400, 500))
    cells = split_window(power, guard=1, window=8)[:, 20:-20]
    expected = (1 + 6.0 / 16) ** -16
    share, count = np.mean(cells > 6.0), cells.size
    # Cells share windows, and are counted here as if eight made one: five standard errors.
    assert abs(share - expected) < 5 * np.sqrt(expected / (count / 8))
    assert scipy.stats.expon.sf(6.0) < 0.5 * expected


def test_from_samples_to_a_track_by_one_command(tmp_path: Path) -> None:
    file = tmp_path / "pings.wav"
    ft.simulate(scenario(), file)
    ft.Scenario(**SECTIONS).save(tmp_path / "s.toml")
    array = "sound_speed = 1500\nchannels = [\n"
    array += "".join(f'  {{name = "{c["name"]}", x = {c["x"]}, y = {c["y"]}}},\n' for c in SQUARE["channels"]) + "]\n"
    (tmp_path / "array.toml").write_text(array)
    out = tmp_path / "out"
    given = ["--array", str(tmp_path / "array.toml"), "--scenario", str(tmp_path / "s.toml"), "--out", str(out)]
    done = CliRunner().invoke(app, ["track", str(file), *given])
    assert done.exit_code == 0, done.output
    result = ft.read_result(out)
    (track,) = result.tracks
    at = track.time[-1]
    east, north = 1800.0 - 5.0 * at, 1200.0 - 3.0 * at
    # A bin of delay is 15 m, a cell of the grid 400 m.
    assert abs(np.hypot(track.mean["x"][-1], track.mean["y"][-1]) - np.hypot(east, north)) < 150
    speed = [float(np.average(track.mean[name][-8:])) for name in ("vx", "vy")]
    assert abs(np.hypot(*speed) - np.hypot(5, 3)) < 1.5
    assert result.scenario.background.shape == pytest.approx(1 / 32)


@pytest.mark.slow
def test_an_echo_in_overlapping_beams_that_fades_keeps_its_label() -> None:
    """Twenty-four beams, each echo in a dozen bins that fade together: ten pings in which it is weak or missing."""
    loud = scenario(sonar={**SECTIONS["sonar"], "beams": 24, "snr_db": 18.0})
    bins = loud.model_copy(update={"sonar": loud.sonar.model_copy(update={"fading": "bin"})})
    returns = returns_of(ft.simulate(loud), loud)
    together, apart = (ft.track(returns, each).tracks for each in (loud, bins))
    assert len(together) == 1
    assert len(apart) > 1


def test_noise_alone_gives_no_track_and_as_many_returns_as_its_tail_says(tmp_path: Path) -> None:
    quiet = scenario(simulation={"pings": 24, "interval": 10.0})
    ft.simulate(quiet, tmp_path / "quiet.wav")
    returns = ft.read(tmp_path / "quiet.wav", scenario=quiet)
    expected = 24 * 201 * 12 * (1 + 10**0.9 / 32) ** -32
    # Neighbouring beams overlap a little: five standard errors of half of the number.
    assert abs(len(returns.delay) - expected) < 5 * np.sqrt(2 * expected)
    assert ft.track(tmp_path / "quiet.wav", quiet).tracks == []


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"array": None}, "there is no array; expected an array"),
        ({"reception": None}, r"there is no \[reception\]"),
        (
            {"array": {"line": {"count": 16, "spacing": 3.5}}},
            "the channels lie on a line, which hears an echo from both",
        ),
        ({"reception": {"ping_times": [500.0, 600.0]}}, "expected at least one whole ping"),
        ({"array": {"channels": SQUARE["channels"][:5]}}, "16 channels"),
    ],
)
def test_bad_input_is_a_sentence(changes: dict[str, Any], says: str, tmp_path: Path) -> None:
    file = tmp_path / "short.wav"
    write_recording(file, [np.zeros((20_000, 16), np.float32)], RATE)
    with pytest.raises(InputError, match=says):
        ft.read(file, scenario=scenario(**changes))


@pytest.mark.parametrize(
    ("section", "says"),
    [
        ({"reception": {"interval": 5.0, "ping_times": [0.0, 5.0]}}, "exactly one of interval and ping_times"),
        ({"reception": {"ping_times": [5.0, 5.0]}}, "expected ascending seconds"),
        (
            {"sonar": {**SECTIONS["sonar"], "pulse": {"frequency": 20.0, "duration": 1.0, "bandwidth": 50.0}}},
            "bandwidth",
        ),
    ],
)
def test_bad_sections_are_a_sentence(section: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        scenario(**section)
