"""The tracker of Stone Soup yields what `faintrack.follow` finds, in the way of Stone Soup's trackers."""

from datetime import datetime, timedelta

import numpy as np
import pytest

import faintrack as ft
from tests import bearings

pytest.importorskip("stonesoup")

from faintrack.results.schema import joined
from faintrack.results.tables import to_stonesoup
from faintrack.results.track import tracks_of
from faintrack.stonesoup import BearingsReader, ScenarioTracker, bearings_of

SCENARIO = bearings.scenario(filter={"particles": 1000, "births": 500}, tracker={"targets": 1})


def test_tracks_are_those_of_follow() -> None:
    data = bearings.drawn(observers=2)
    result = joined([moment.data for moment in ft.follow(data, SCENARIO)])
    tracker = ScenarioTracker(data, SCENARIO)
    times, known = [], {}
    label = result.label.values
    for scan, (time, tracks) in enumerate(tracker):
        times.append(time)
        assert {track.id for track in tracks} == {str(number) for number in label[scan] if number > 0}
        assert tracks == tracker.tracks
        for track in tracks:
            assert known.setdefault(track.id, track) is track
            assert track.timestamp == time
    # Times of the file are seconds from the start of 1970, for want of a date.
    start = datetime(1970, 1, 1) + timedelta(seconds=bearings.START)
    assert times == [start + timedelta(seconds=scan) for scan in range(bearings.SCANS)]
    expected = to_stonesoup(tracks_of(result))
    assert expected
    assert set(known) == {track.id for track in expected}
    for theirs in expected:
        mine = known[theirs.id]
        np.testing.assert_array_equal(
            np.hstack([state.mean for state in mine]), np.hstack([state.mean for state in theirs])
        )
        np.testing.assert_array_equal([state.covar for state in mine], [state.covar for state in theirs])
        assert mine.metadatas == theirs.metadatas
        assert mine.metadata["components"] == ("x", "vx", "y", "vy")
        assert 0 < mine.metadata["existence"] <= 1


def test_detections_of_a_reader_come_out_with_their_dates() -> None:
    begin = datetime(2031, 5, 6, 7, 8, 9, 250_000)
    shift = (begin - datetime(1970, 1, 1)).total_seconds() - bearings.START
    reported = [
        (time + timedelta(seconds=shift), found) for time, found in BearingsReader(bearings.drawn(), error_deg=1.0)
    ]
    times = [time for time, _ in ScenarioTracker(bearings_of(reported), SCENARIO)]
    assert times == [begin + timedelta(seconds=scan) for scan in range(bearings.SCANS)]
