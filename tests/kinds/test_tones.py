"""Tones of unknown frequency: from a scenario to a table with frequencies."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import faintrack as ft
from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.results.result import Result

ARRAY = {"sound_speed": 1500.0, "line": {"count": 8, "spacing": 1.5}}


def scenario(**sections: Any) -> dict[str, Any]:
    return {
        "kind": "recording",
        "array": ARRAY,
        "analysis": {"band": [100.0, 450.0], "beams": 48},
        "likelihood": {"kind": "tone"},
        "filter": {"particles": 1000, "births": 2000},
        "tracker": {"targets": 3},
        **sections,
    }


def simulated(*sources: dict[str, Any], seconds: float = 16.0) -> dict[str, Any]:
    return scenario(simulation={"duration": seconds, "sample_rate": 1000.0, "sources": list(sources)})


QUIET = {"tone": 233.3, "snr_db": -12.0, "bearing_deg": 70.0, "start": 3.0}
LOUD = {"tone": 333.4, "snr_db": 20.0, "bearing_deg": 120.0, "start": 3.0}
SHIP = {"snr_db": 3.0, "bearing_deg": 40.0}
"""At all frequencies."""


@pytest.fixture(scope="module")
def followed() -> Result:
    made = simulated(QUIET, LOUD, SHIP)
    return ft.track(ft.simulate(made), scenario())


def test_tones_are_found_and_a_ship_that_is_loud_everywhere_is_none(followed: Result) -> None:
    tracks = sorted(followed.tracks, key=lambda track: float(track.mean["frequency"][-1]))
    assert len(tracks) == 2
    for track, source in zip(tracks, (QUIET, LOUD), strict=True):
        assert 3.0 < track.start_s < 10.0
        assert track.end_s == 15.5
        np.testing.assert_allclose(track.mean["frequency"][-3:], source["tone"], atol=0.2)
        np.testing.assert_allclose(track.mean["bearing"][-3:], source["bearing_deg"], atol=2.0)


def test_truth_and_table_have_frequencies(followed: Result, tmp_path: Path) -> None:
    followed.save(tmp_path / "result")
    states = pd.read_csv(tmp_path / "result" / "states.csv")
    assert {"frequency_hz", "frequency_hz_std"} <= set(states.columns)
    (known, *_) = kind_named("recording").targets(ft.Scenario(**simulated(QUIET)))
    assert known.at(np.array([1.0, 5.0]))["frequency"].tolist() == pytest.approx([np.nan, 233.3], nan_ok=True)
    axes = followed.plot().axes
    assert any("frequency" in axis.get_ylabel() for axis in axes)


def test_the_scenario_says_what_was_chosen() -> None:
    data = ft.simulate(simulated(QUIET, seconds=3.0))
    plain = scenario()
    del plain["filter"]
    chosen = kind_named("recording").plan(data, ft.Scenario(**plain)).scenario
    assert (chosen.filter.particles, chosen.filter.births) == (4000, 8000)
    assert chosen.analysis.snapshot is None
    assert ft.Scenario(**chosen.model_dump()) == chosen


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        ({"tracker": {"method": "cfar"}}, "knows of no frequency"),
        ({"analysis": {"snapshot": 0.1}}, "no snapshot"),
        ({"target": {"elevation_deg": [0, 40]}}, "hears level waves only"),
    ],
)
def test_what_tones_do_not_go_with_is_refused(sections: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        ft.Scenario(**scenario(**sections))


def test_a_line_that_turns_and_a_tone_beyond_the_band_are_refused(tmp_path: Path) -> None:
    heading = tmp_path / "heading.csv"
    heading.write_text("time_s,heading_deg\n0,0\n10,5\n", encoding="utf-8")
    data = ft.simulate(simulated(QUIET, seconds=3.0))
    with pytest.raises(InputError, match="sides of a line are not told apart by tones"):
        ft.track(data, scenario(heading=str(heading)))
    with pytest.raises(InputError, match=r"sources\[0\].tone is 600 Hz"):
        ft.simulate(simulated(QUIET | {"tone": 600.0}))
    with pytest.raises(InputError, match="too few bins"):
        ft.track(data, scenario(analysis={"band": [100.0, 100.5]}))


def test_data_without_tones_are_not_made_by_shifting_channels() -> None:
    room = kind_named("recording")
    assert room.surrogate is not None
    with pytest.raises(InputError, match="as steady when channels are shifted"):
        room.surrogate(ft.simulate(simulated(QUIET, seconds=3.0)), ft.Scenario(**scenario()), 0)
