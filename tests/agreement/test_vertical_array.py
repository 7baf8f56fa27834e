"""Arrivals at a real vertical array: beam power in elevation, with two that fade and something loud after 88 s."""

import math
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import between
from faintrack.likelihoods.beam_energies import BeamEnergies
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.trackers.several import SeveralEstimate, bearing_tracker

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "swellex96_s5" / "rbd_time_series_0_400s.npz"
DEGREE = math.radians(1)
WIDTH = 8
"""From one beam to the next; that of an arrival. Degrees."""
ELEVATION = np.arange(-41, 42, WIDTH)
DEVIATION_DB, LEVEL = 0.6, 2.5
"""Of a beam's power over the mean of its neighbours', and what an arrival adds in deviations."""

pytestmark = pytest.mark.skipif(not DATA.exists(), reason="the vertical array's record is not beside the project")


def record() -> EnergyScan:
    """Power of each beam over the geometric mean of both neighbours', in deviations."""
    with np.load(DATA) as data:
        power, time = 10 * np.log10(data["beam_power"]), data["window_center_time_s"]
    middle = ELEVATION + 90
    beams = power[:, middle - 1] + power[:, middle] + power[:, middle + 1]
    beside = power[:, middle - WIDTH] + power[:, middle + WIDTH]
    energy = (beams / 3 - beside / 2) / DEVIATION_DB
    stands = Stations(*(jnp.zeros((len(time), 1)),) * 3)
    energy = jnp.asarray(energy[:, None], jnp.float32)
    return EnergyScan(jnp.asarray(time, jnp.float32), energy, jnp.ones(energy.shape, bool), stands)


@pytest.fixture(scope="module")
def found() -> SeveralEstimate:
    # Bearings are from the array's axis: elevation and a right angle.
    fans = Fans((float(ELEVATION[0] + 90) * DEGREE,), (WIDTH * DEGREE,), (len(ELEVATION),), (True,))
    tracker = bearing_tracker(
        BeamEnergies(fans, present_mean=LEVEL, present_std=1.3),
        bearing=between(45 * DEGREE, 135 * DEGREE, 45),
        bearing_rate=between(-0.5 * DEGREE, 0.5 * DEGREE, 5),
        rate_noise=0.05 * DEGREE,
        interval=1.0,
        arrival_rate=1e-3,
        departure_rate=1e-3,
        slots=4,
        particles=1024,
    )
    return tracker.steps(tracker.init(jax.random.key(0)), record(), jax.random.key(1))[1]


@pytest.mark.parametrize(("label", "elevation"), [(1, -9), (2, 7)])
def test_two_arrivals_are_held_to_the_end(found: SeveralEstimate, label: int, elevation: int) -> None:
    """Each as one track, through what is loud after 88 s, within half a beam of where its power is on average."""
    scan, slot = np.nonzero(np.asarray(found.label) == label)
    assert scan[0] < 30
    np.testing.assert_array_equal(scan, np.arange(scan[0], len(found.label)))
    held = np.degrees(np.asarray(found.mean.bearing)[scan, slot]) - 90
    print(f"from scan {scan[0]}: {held.mean():.1f} degrees, standard deviation {held.std():.1f}")
    assert np.abs(held.mean() - elevation) < 1
    assert np.abs(held - elevation).max() < WIDTH


def test_what_else_is_declared_is_short(found: SeveralEstimate) -> None:
    """A shoulder at 23 degrees is taken for an arrival for less than a fifth of the record."""
    label = np.asarray(found.label)
    print(f"others in scans {np.flatnonzero(np.any(label > 2, axis=1)).tolist()}")
    assert np.mean(np.any(label > 2, axis=1)) < 0.2
