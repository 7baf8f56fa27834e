"""A threshold for a scenario: by the identity where there is a likelihood ratio, by counting where there is none."""

import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.kinds.calibration import Calibrated, calibrate
from faintrack.scenario import Scenario
from faintrack.scenario.model import Analysis, FilterTable, LikelihoodTable, TargetTable, TrackerTable
from faintrack.sensors.array import line_array

ARRAY, RATE = line_array(4, 1.5), 500.0
SMALL = Scenario(
    analysis=Analysis(frame=0.064, snapshot=0.016, beams=24),
    target=TargetTable(arrival_rate=0.5, departure_rate=0.5, snr_db=(-6.0, 10.0)),
    filter=FilterTable(particles=50, births=20, guided=False),
)
"""Three bins, four snapshots, 24 beams, 50 particles."""
DURATION, FRAMES = 0.64, 10


def calibrated(scenario: Scenario, runs: int, probability: float = 0.1) -> tuple[Calibrated, list[tuple[int, int]]]:
    """The threshold, and what was told on the way to it."""
    told: list[tuple[int, int]] = []
    found = calibrate(
        scenario, ARRAY, RATE, probability, DURATION, runs, told=lambda drawn, total: told.append((drawn, total))
    )
    return found, told


def changed(**tables: object) -> Scenario:
    return SMALL.model_copy(update=tables)


def test_a_likelihood_ratio_is_calibrated_by_the_identity() -> None:
    """64 runs with a target, and a quarter as many without one."""
    found, told = calibrated(SMALL, 64)
    assert found.by == "Wald's identity"
    assert 0 < found.threshold.low <= found.threshold.value <= found.threshold.high < 1
    assert found.threshold.low < found.threshold.high
    assert found.runs == sum(drawn for drawn, _ in told) == 64 + 16
    assert {total for _, total in told} == {80}


@pytest.mark.parametrize(
    "tables",
    [
        pytest.param({"likelihood": LikelihoodTable(kind="lobe_width")}, marks=pytest.mark.slow),
        {"tracker": TrackerTable(method="cfar")},
    ],
    ids=["lobe width", "cfar"],
)
def test_what_is_no_ratio_is_calibrated_by_counting(tables: dict[str, object]) -> None:
    """100 runs, the last batch of which is not full."""
    found, told = calibrated(changed(**tables), 100)
    assert found.by == "counting"
    assert 0 < found.threshold.low <= found.threshold.value <= found.threshold.high < 1
    assert found.runs == sum(drawn for drawn, _ in told) == 100
    assert {total for _, total in told} == {100}


@pytest.mark.parametrize("probability", [2.0, 1.0, 0.0, -0.1, np.nan])
def test_probability_out_of_range(probability: float) -> None:
    with pytest.raises(InputError, match=r"probability is .*; expected a number between 0 and 1"):
        calibrate(SMALL, ARRAY, RATE, probability)


@pytest.mark.parametrize("duration", [0.0, 0.03, -1.0, np.nan, np.inf, 1e12])
def test_duration_out_of_range(duration: float) -> None:
    with pytest.raises(InputError, match=r"duration is .* s; expected from 0\.064 s, one frame, to 6400 s"):
        calibrate(SMALL, ARRAY, RATE, duration=duration)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_sample_rate_that_is_none(rate: float) -> None:
    with pytest.raises(InputError, match=r"sample rate is .* Hz; expected a number above 0"):
        calibrate(SMALL, ARRAY, rate)


def test_runs_that_would_not_end() -> None:
    cfar = SMALL.model_copy(update={"tracker": TrackerTable(method="cfar")})
    with pytest.raises(InputError, match="probability is 1e-300; counted it takes more than 10,000,000 runs"):
        calibrate(cfar, ARRAY, RATE, 1e-300)
