"""Tracks on detections made by hand: Kalman's estimate, the module's score, and how tracks begin, merge and end."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import expit, logit

from faintrack.baselines.cfar import cell_averaging
from faintrack.baselines.detect_and_track import DetectAndTrack, Standing
from faintrack.sensors.array import line_array, sensor_array
from faintrack.sensors.beams import BeamGrid, BeamScan, lobe_width
from faintrack.targets.motion import BearingMotion
from faintrack.targets.states import BearingState
from faintrack.targets.target import Target, UniformBirth, rates
from faintrack.trackers.single import Estimate
from tests.scenes import Scene
from tests.tolerances import assert_equal

BEAMS = 181
BIRTH, SURVIVAL, RATE_NOISE, LARGEST_RATE = 0.02, 0.95, 0.005, 0.05
FALSE, SEEN, BEARING_STD, LOBE, DELETION = 0.3, 0.7, 0.02, 0.2, 10.0
OPERATIONS = 30
"""Roundings from a scan's powers to a track, over a few scans."""
KEY = jax.random.key(0)


def target(circular: bool) -> Target:
    def corner(*values: float) -> BearingState:
        return BearingState(*(jnp.asarray(value, jnp.float32) for value in values))

    birth = UniformBirth(corner(0.0, -LARGEST_RATE, -10.0), corner(np.pi, LARGEST_RATE, 3.0))
    return Target(birth, BearingMotion(RATE_NOISE, circular=circular), *rates(BIRTH, SURVIVAL, 1.0))


def tracker(circular: bool = False) -> DetectAndTrack:
    grid = BeamGrid(np.array([100.0]), BEAMS, snapshots=1, circular=circular)
    detector = cell_averaging(grid, guard=2, window=4, threshold=2.0)
    return DetectAndTrack(
        detector, target(circular), FALSE, BEARING_STD, LOBE, SEEN, deletion=DELETION, capacity=4, starts=2
    )


def scan(
    time: float, *bearings: float, channels: float = 4.0, circular: bool = False, height: float = 10.0
) -> BeamScan:
    """Power 1, and about each bearing three beams on a parabola whose top is there."""
    grid = BeamGrid(np.array([100.0]), BEAMS, snapshots=1, circular=circular).bearing
    power = np.ones(BEAMS)
    for bearing in bearings:
        place = (bearing - grid[0]) / (grid[1] - grid[0])
        beams = round(place) + np.array([-1, 0, 1])
        power[beams % BEAMS] = height * (1 - 0.2 * (beams - place) ** 2)
    fields = (time, power[None], np.ones(1), channels)
    return BeamScan(*(jnp.asarray(values, jnp.float32) for values in fields))


@eqx.filter_jit
def take_in(tracker: DetectAndTrack, standing: Standing, scan: BeamScan) -> tuple[Standing, Estimate]:
    return tracker.step(standing, scan, KEY)


def follow(tracker: DetectAndTrack, *scans: BeamScan) -> list[tuple[Standing, Estimate]]:
    """State and estimate after every scan."""
    standing, moments = tracker.init(KEY), []
    for each in scans:
        standing, estimate = take_in(tracker, standing, each)
        moments.append((standing, estimate))
    return moments


def scores(standing: Standing) -> np.ndarray:
    """Of the tracks that there are, in the order of their places."""
    score = np.asarray(standing.tracks.score)
    return score[score > -np.inf]


def bearings(standing: Standing) -> np.ndarray:
    """Of the tracks that there are, in order."""
    return np.sort(np.asarray(standing.tracks.bearing)[np.asarray(standing.tracks.score) > -np.inf])


def noise(bearing: float, circular: bool = False) -> float:
    """Variance of a detection's bearing."""
    return BEARING_STD**2 / (1.0 if circular else max(np.sin(bearing), 0.2) ** 2)


def newborn() -> float:
    """Score of a track that has just begun."""
    return float(np.log(BIRTH * SEEN / np.pi / (FALSE / np.pi)))


def survived(score: float, survival: float = SURVIVAL) -> float:
    return float(logit(survival * expit(score)))


# One track


def test_one_track_is_a_kalman_filter() -> None:
    """Scans at odd times, one of them without a detection."""
    heard = [(1.0, 1.0), (2.0, 1.03), (2.5, 1.02), (4.0, None), (5.0, 1.1), (7.0, 1.2), (8.0, 1.24)]
    moments = follow(tracker(), *(scan(time, *([] if bearing is None else [bearing])) for time, bearing in heard))
    look = np.array([1.0, 0.0])
    middle, spread = np.array([1.0, 0.0]), np.diag([noise(1.0), (2 * LARGEST_RATE) ** 2 / 12])
    for number, (time, bearing) in enumerate(heard):
        if number:
            interval = time - heard[number - 1][0]
            move = np.array([[1.0, interval], [0.0, 1.0]])
            accelerated = np.array([[interval**3 / 3, interval**2 / 2], [interval**2 / 2, interval]])
            middle, spread = move @ middle, move @ spread @ move.T + RATE_NOISE**2 * accelerated
            if bearing is not None:
                innovation, variance = bearing - look @ middle, look @ spread @ look + noise(middle[0])
                assert abs(innovation) < 3 * np.sqrt(variance)
                gain = spread @ look / variance
                middle, spread = middle + gain * innovation, spread - np.outer(gain, look @ spread)
        standing, estimate = moments[number]
        row = int(np.argmax(standing.tracks.score))
        assert len(scores(standing)) == 1
        assert_equal([estimate.mean.bearing, estimate.mean.bearing_rate], middle, np.float32, OPERATIONS, 1.0)
        assert_equal([estimate.std.bearing, estimate.std.bearing_rate], np.sqrt(np.diag(spread)), np.float32, 300)
        found = standing.tracks.covariance[row]
        assert_equal(found, [spread[0, 0], spread[0, 1], spread[1, 1]], np.float32, 300, scale=spread.max())


def test_the_score_by_hand() -> None:
    """Begun, hit, missed, hit, and survival over intervals that differ."""
    heard = [(1.0, 1.5), (2.0, 1.51), (4.0, None), (5.0, 1.5)]
    moments = follow(tracker(), *(scan(time, *([] if bearing is None else [bearing])) for time, bearing in heard))
    model, expected = target(False), newborn()
    assert_equal(scores(moments[0][0]), [expected], np.float32, OPERATIONS)
    for number in range(1, len(heard)):
        (time, bearing), (before, _) = heard[number], moments[number - 1]
        interval = time - heard[number - 1][0]
        expected = survived(expected, float(model.transition(interval)[1]))
        if bearing is None:
            expected += np.log(1 - SEEN)
        else:
            row = int(np.argmax(before.tracks.score))
            middle = float(before.tracks.bearing[row] + interval * before.tracks.bearing_rate[row])
            first, both, second = np.asarray(before.tracks.covariance[row], float)
            variance = first + 2 * interval * both + interval**2 * second + RATE_NOISE**2 * interval**3 / 3
            variance += noise(middle)
            density = np.exp(-0.5 * (bearing - middle) ** 2 / variance) / np.sqrt(2 * np.pi * variance)
            expected += np.log(SEEN * density / (FALSE / np.pi))
        assert_equal(scores(moments[number][0]), [expected], np.float32, OPERATIONS, scale=3.0)
        assert_equal(moments[number][1].existence, expit(expected), np.float32, 10 * OPERATIONS)


def test_a_frame_that_is_not_heard_changes_no_score_by_measurement() -> None:
    moments = follow(
        tracker(), scan(1.0, 1.5), scan(2.0, 1.5), scan(3.0, 1.5, channels=1.0), scan(4.0, 0.5, channels=0.0)
    )
    (heard,), (deaf,), (still,) = (scores(standing) for standing, _ in moments[1:])
    assert_equal(deaf, survived(heard), np.float32, OPERATIONS)
    assert_equal(still, survived(survived(heard)), np.float32, OPERATIONS)


@pytest.mark.parametrize(("end", "rate"), [(0.0, -0.04), (np.pi, 0.04)])
def test_a_line_reflects_a_track_at_its_ends(end: float, rate: float) -> None:
    """Towards the end for twelve scans, and then unheard."""
    near = end - 12.5 * rate
    heard = [scan(1.0 + n, near + n * rate) for n in range(12)]
    moments = follow(tracker(), *heard, *(scan(13.0 + n) for n in range(4)))
    turned = moments[-1][1].mean
    assert 0 <= turned.bearing <= np.pi
    assert turned.bearing_rate * rate < 0
    assert abs(abs(turned.bearing_rate) - 0.04) < 0.01
    assert moments[-1][1].existence > 0


# Many tracks


def test_a_track_is_declared_held_and_dropped() -> None:
    heard = [scan(1.0 + n, 1.5) for n in range(6)] + [scan(7.0 + n) for n in range(6)]
    heard += [scan(13.0 + n, 0.7) for n in range(6)]
    follower = tracker()
    moments = follow(follower, *heard)
    label = np.array([int(estimate.label) for _, estimate in moments])
    own = np.array([float(estimate.track_existence) for _, estimate in moments])
    (begins,), (ends,) = (np.flatnonzero(np.diff(label, prepend=0) == step) for step in (1, -1))
    # The second source is told by its own number.
    assert sorted(set(label)) == [0, 1, 2]
    assert own[begins] >= follower.declare > own[begins - 1]
    assert own[ends - 1] >= follower.drop
    assert 6 < ends < 12
    assert len(scores(moments[ends][0])) == 1
    again = np.flatnonzero(label == 2)
    assert again[0] > 12
    assert (label[again[0] :] == 2).all()
    for number, bearing in ((5, 1.5), (17, 0.7)):
        assert abs(moments[number][1].mean.bearing - bearing) < BEARING_STD


def test_a_track_that_falls_far_below_its_best_is_deleted() -> None:
    """Each miss takes 1.2 of the score; survival takes of the score and of its best alike."""
    moments = follow(tracker(), *(scan(1.0 + n, 1.5) for n in range(6)), *(scan(7.0 + n) for n in range(14)))
    highest = expected = float(moments[5][0].tracks.highest.max())
    assert_equal(scores(moments[5][0]), [highest], np.float32, OPERATIONS)
    left = []
    for standing, _ in moments[6:]:
        expected, highest = survived(expected) + np.log(1 - SEEN), survived(highest)
        left.append(expected >= highest - DELETION)
        assert len(scores(standing)) == left[-1]
    # However sure the track was, it takes more misses than deletion / 1.2 to end it.
    assert left.index(False) >= int(DELETION / -np.log(1 - SEEN))


@pytest.mark.parametrize(("apart", "left"), [(0.07, 1), (0.13, 2)])
def test_tracks_within_half_a_lobe_merge(apart: float, left: int) -> None:
    """Two begin in one scan; at the next the better is kept where they are closer than 0.1."""
    first, second = 1.5 - apart / 2, 1.5 + apart / 2
    # The second is found a little off its prediction, so that the first is the better.
    (begun, _), (met, _) = follow(tracker(), scan(1.0, first, second), scan(2.0, first, second + 0.01))
    assert len(bearings(begun)) == 2
    np.testing.assert_allclose(bearings(met), [first, second + 0.01][:left], atol=BEARING_STD / 2)


def test_no_more_tracks_than_places_and_the_worst_is_replaced() -> None:
    """Four places, two starts a scan."""
    moments = follow(
        tracker(),
        scan(1.0, 0.5, 1.0),
        scan(2.0, 0.5, 1.0, 1.5, 2.0),
        # The track at 1.5 is missed once and worse than a new one, which takes its place.
        scan(3.0, 0.5, 1.0, 2.0),
        scan(4.0, 0.5, 1.0, 2.0, 2.5),
        # All four are seen again and better than a new one: there is no place for it.
        scan(5.0, 0.5, 1.0, 2.0, 2.5, 1.5),
    )
    assert [len(bearings(standing)) for standing, _ in moments] == [2, 4, 4, 4, 4]
    np.testing.assert_allclose(bearings(moments[2][0]), (0.5, 1.0, 1.5, 2.0), atol=BEARING_STD)
    assert scores(moments[2][0]).min() < newborn()
    for standing, _ in moments[3:]:
        np.testing.assert_allclose(bearings(standing), (0.5, 1.0, 2.0, 2.5), atol=BEARING_STD)
    assert_equal(scores(moments[3][0]).min(), newborn(), np.float32, OPERATIONS)
    assert scores(moments[4][0]).min() > newborn()


def test_the_strongest_detections_begin_tracks() -> None:
    weak, strong = scan(1.0, 0.5, 1.0, height=5.0), scan(1.0, 1.5, 2.0)
    both = dataclasses.replace(weak, beam_power=jnp.maximum(weak.beam_power, strong.beam_power))
    ((standing, _),) = follow(tracker(), both)
    np.testing.assert_allclose(bearings(standing), (1.5, 2.0), atol=1e-4)


def test_a_track_across_the_seam_of_a_circle() -> None:
    """From 178 to 182 degrees, a degree a scan; every bearing within half a turn of north."""
    course = np.radians([178.0, 179.0, 180.0, 181.0, 182.0, 183.0])
    wrapped = (course + np.pi) % (2 * np.pi) - np.pi
    moments = follow(tracker(True), *(scan(1.0 + n, b, circular=True) for n, b in enumerate(wrapped)))
    assert [len(bearings(standing)) for standing, _ in moments] == [1] * len(course)
    found = np.array([float(estimate.mean.bearing) for _, estimate in moments])
    assert (np.abs(found) <= np.pi * (1 + 1e-6)).all()
    off = (found - course + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(off).max() < BEARING_STD
    assert abs(float(moments[-1][1].mean.bearing_rate) - np.radians(1)) < 0.01


def test_a_track_that_begins_at_the_seam_lies_within_half_a_turn() -> None:
    """A peak a third of a beam before the first beam, which is at -180 degrees."""
    spacing = 2 * np.pi / BEAMS
    ((_, estimate),) = follow(tracker(True), scan(1.0, -np.pi - spacing / 3, circular=True))
    assert abs(float(estimate.mean.bearing) - (np.pi - spacing / 3)) < 1e-4


# From sound to tracks

RING = np.linspace(0, 2 * np.pi, 8, endpoint=False)[:, None]
COURSES = {
    "line": (line_array(8, 1.5), np.linspace(1.0, 1.8, 40)),
    "circle": (sensor_array(3 * np.concatenate([np.sin(RING), np.cos(RING)], axis=1)), np.linspace(2.9, 3.5, 40)),
}
"""Array, and bearing of a source in each frame; on the circle it passes 180 degrees."""
THRESHOLD = 4.0
"""Above what side lobes are over the beams around them."""


@pytest.mark.parametrize("case", COURSES)
def test_a_loud_source_is_followed_within_a_lobe(case: str) -> None:
    """6 dB at a channel: declared within ten frames, and never out of the main lobe from then on."""
    array, course = COURSES[case]
    scene = Scene(np.float32, array)
    lobe = lobe_width(array, float(scene.grid.frequency.mean()))
    detector = cell_averaging(scene.grid, guard=5, window=6, threshold=THRESHOLD)
    follower = DetectAndTrack(detector, scene.target, false_detections=0.5, bearing_std=lobe / 4, lobe=lobe)
    wrapped = (course + np.pi) % (2 * np.pi) - np.pi
    scans = scene.draw(jax.random.key(3), len(course), bearing=wrapped, snr_db=6.0)
    standing, estimates = follower.steps(follower.init(KEY), scans, KEY)
    held = np.asarray(estimates.label) > 0
    declared = int(np.argmax(held))
    assert held.any()
    assert declared < 10
    assert held[declared:].all()
    assert set(np.asarray(estimates.label)[held].tolist()) == {1}
    off = (np.asarray(estimates.mean.bearing) - course + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(off[declared:]).max() < lobe
    assert int(standing.reported) == 1
