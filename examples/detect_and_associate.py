"""Detect and track on the data of the study kreucher2011: beams above a threshold, intersected, Stone Soup's JPDA.

The other way to fuse two arrays: local maxima of the beams above a threshold, every bearing of one array intersected
with every bearing of the other, and what falls into the region tracked by joint probabilistic data association. Most of
it is false: three targets have six such crossings beside their own. Needs Stone Soup (`pip install stonesoup`):

    python examples/detect_and_associate.py --runs 8 --out docs/validation_data/kreucher2011_jpda.json
"""

import argparse
import datetime
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDA
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.tracker.simple import MultiTargetMixtureTracker
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import KalmanUpdater

from faintrack.metrics.intervals import bootstrap_interval
from faintrack.metrics.sets import gospa
from faintrack.studies.kreucher2011 import runs, scene
from faintrack.studies.kreucher2011.tracks import CUTOFF, SETTLED
from faintrack.studies.kreucher2011.triangulation import crossing
from faintrack.studies.study import address

START = datetime.datetime(2000, 1, 1)
BEARING_STD = scene.DEGREE / 3
DETECTION = {2.5: 0.69, 3.0: 0.5}
"""Detection probability of a beam of level 3 at a threshold."""
POINTS, MISSES = 8, 12
"""Detections that make a track, and scans without one that end it."""


def peaks(energy: np.ndarray, threshold: float) -> np.ndarray:
    """Beams above the threshold that are higher than their neighbours."""
    beside = np.pad(energy, 1, constant_values=-np.inf)
    return np.flatnonzero((energy > threshold) & (energy >= beside[:-2]) & (energy > beside[2:]))


def crossings(scan: np.ndarray, threshold: float) -> tuple[np.ndarray, np.ndarray]:
    """Places in the region where bearings of both arrays cross, and their covariances."""
    first, second = (peaks(energy, threshold) for energy in scan)
    pairs = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1).reshape(-1, 2)
    bearings = scene.DEGREE * pairs.T.astype(float)
    place, slopes = cross_with_slopes(bearings)
    (east, west), (north, south) = (ends for ends in scene.REGION)
    inside = (place[:, 0] > east) & (place[:, 0] < west) & (place[:, 1] > north) & (place[:, 1] < south)
    inside &= bearings[1] > bearings[0] + scene.DEGREE
    return place[inside], BEARING_STD**2 * (slopes @ slopes.swapaxes(1, 2))[inside]


def cross_with_slopes(bearings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Crossings, and how they move with either bearing; m, m/rad."""

    def place(bearings: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(cross(bearings))

    step = 1e-4
    middle = place(bearings)
    moved = [(place(bearings + step * np.eye(2)[:, [i]]) - middle) / step for i in range(2)]
    return middle, np.stack(moved, axis=-1)


@jax.jit
def cross(bearings: jax.Array) -> jax.Array:
    """Crossings of columns of two bearings."""
    return crossing(scene.stations(), jnp.asarray(bearings)[None])[0]


def track(energy: np.ndarray, threshold: float) -> list[np.ndarray]:
    """Places of the tracks after every scan."""
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(scene.NOISE**2)] * 2)
    predictor, updater = KalmanPredictor(motion), KalmanUpdater(None)
    area = (scene.REGION[0][1] - scene.REGION[0][0]) * (scene.REGION[1][1] - scene.REGION[1][0])
    places = [crossings(scan, threshold) for scan in energy]
    clutter = max(np.mean([len(found) for found, _ in places]) - 3, 0.1) / area
    detected = DETECTION[threshold] ** 2

    def detector() -> object:
        for number, (found, covariances) in enumerate(places):
            when = START + datetime.timedelta(seconds=number + 1)
            yield (
                when,
                {
                    Detection(place[:, None], timestamp=when, measurement_model=LinearGaussian(4, (0, 2), covariance))
                    for place, covariance in zip(found, covariances, strict=True)
                },
            )

    prior = GaussianState(np.zeros((4, 1)), np.diag([0.0, 25.0, 0.0, 25.0]), timestamp=START)
    deleter = UpdateTimeStepsDeleter(MISSES)
    near = DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=3)
    initiator = MultiMeasurementInitiator(
        prior, deleter, GNNWith2DAssignment(near), updater, min_points=POINTS, updates_only=True
    )
    hypothesiser = PDAHypothesiser(
        predictor, updater, clutter_spatial_density=clutter, prob_detect=detected, prob_gate=0.99
    )
    tracker = MultiTargetMixtureTracker(initiator, deleter, detector(), JPDA(hypothesiser), updater)
    return [
        np.array([[float(each.mean[0]), float(each.mean[2])] for each in tracks]).reshape(-1, 2)
        for _, tracks in tracker
    ]


def main() -> None:
    """GOSPA of both thresholds over the runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    result: dict[str, dict[str, object]] = {}
    for threshold in DETECTION:
        totals, tracks = [], []
        for run in range(options.runs):
            truth, scans, _ = jax.jit(runs.drawn)(address(0, "synthetic", run), scene.LEVEL)
            found = track(np.asarray(scans.energy), threshold)
            true = np.stack([truth.x, truth.y], axis=-1)
            each = [gospa(places, at, CUTOFF) for places, at in zip(found, true, strict=True)][SETTLED - 1 :]
            totals.append(np.mean([one.total for one in each]))
            tracks.append(np.mean([len(places) for places in found[SETTLED - 1 :]]))
            print(f"threshold {threshold}, run {run}: GOSPA {totals[-1]:.1f} m, {tracks[-1]:.1f} tracks", flush=True)
        interval = bootstrap_interval(lambda values: float(values.mean()), np.array(totals), 400)
        result[f"threshold_{threshold:g}"] = {
            "runs": options.runs,
            "gospa": round(float(np.mean(totals)), 1),
            "interval": [round(float(bound), 1) for bound in interval],
            "tracks": round(float(np.mean(tracks)), 1),
        }
    options.out.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
