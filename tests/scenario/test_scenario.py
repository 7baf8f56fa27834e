"""A scenario survives its file, and its units are converted once."""

import math
from pathlib import Path

import numpy as np
import pytest

from faintrack import InputError, Scenario, line_array
from faintrack.kinds.beamforming import build_beamformer
from faintrack.kinds.recording.build import build_tracker
from faintrack.kinds.recording.simulate import sources_of
from faintrack.likelihoods.lobe_width import LobeWidth
from faintrack.likelihoods.unknown_noise import UnknownNoise
from faintrack.likelihoods.white_signal import WhiteSignal

EMPTY = 'kind = "recording"\n'
FULL = """
[array]
channels = [{name = "a", x = 0.0, y = 0.0}, {name = "b", x = 1.0, y = 2.0, gain = 0.5}]
dead = ["a"]
[analysis]
band = [10.0, 100.0]
frame = 2.0
beams = 90
[target]
snr_db = [-30.0, 0.0]
bearing_rate_deg = 1.0
[likelihood]
kind = "known_noise"
noise_power = 2.0
[filter]
particles = 500
[tracker]
declare = 0.9
drop = 0.1
[simulation]
duration = 10.0
sample_rate = 400.0
noise_slope_db = -6.0
sources = [{snr_db = -10.0, bearing_deg = 90.0, bearing_rate_deg = 1.0, start = 2.0, end = 8.0}]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "scenario.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("text", [EMPTY, FULL])
def test_written_and_read_again(tmp_path: Path, text: str) -> None:
    scenario = Scenario.read(written(tmp_path, text))
    assert Scenario.read(written(tmp_path, scenario.to_toml())) == scenario


def test_units_are_converted(tmp_path: Path) -> None:
    scenario = Scenario.read(written(tmp_path, FULL))
    assert scenario.simulation is not None
    (source,) = sources_of(scenario.simulation)
    assert source.bearing == pytest.approx(math.pi / 2)
    assert source.bearing_rate == pytest.approx(math.pi / 180)
    array = line_array(8, 1.0)
    plan = build_beamformer(scenario.analysis, array, 400.0)
    birth = build_tracker(scenario, array, plan).filter.target.birth
    assert float(birth.high.bearing_rate) == pytest.approx(math.pi / 180)
    assert float(birth.high.bearing) == pytest.approx(math.pi)


@pytest.mark.parametrize(
    ("table", "kind"),
    [
        ('kind = "unknown_noise"', UnknownNoise),
        ('kind = "known_noise"\nnoise_power = 1.0', WhiteSignal),
        ('kind = "lobe_width"', LobeWidth),
    ],
)
def test_each_likelihood_is_built(tmp_path: Path, table: str, kind: type) -> None:
    scenario = Scenario.read(written(tmp_path, f"{EMPTY}[likelihood]\n{table}\n"))
    array = line_array(8, 1.0)
    tracker = build_tracker(scenario, array, build_beamformer(scenario.analysis, array, 400.0))
    assert isinstance(tracker.likelihood, kind)


def test_source_that_ends_before_it_starts(tmp_path: Path) -> None:
    scenario = Scenario.read(written(tmp_path, FULL.replace("end = 8.0", "end = 1.0")))
    assert scenario.simulation is not None
    with pytest.raises(InputError, match=r"sources\[0\].end is 1 s"):
        sources_of(scenario.simulation)


def test_defaults_need_no_file() -> None:
    scenario = Scenario(kind="recording")
    assert scenario.array is None
    assert scenario.likelihood.kind == "unknown_noise"
    assert np.isclose(scenario.analysis.frame, 1.0)
