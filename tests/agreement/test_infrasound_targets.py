"""Two sources of a real infrasound recording, each a target of its own that one array hears."""

import math
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.axis import between
from faintrack.io import read
from faintrack.likelihoods.beam_energies import BeamEnergies
from faintrack.scenario.model import Scenario
from faintrack.sensors.array import sensor_array
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.session_stations import beamformed
from faintrack.trackers.several import SeveralEstimate, bearing_tracker

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "infrasound_array"
PLACES = [[-66.5, -44.5, 0.0], [-32.5, 77.8, 0.0], [88.2, -22.1, 0.0], [10.8, -11.1, 0.0]]
FRAME, BEAMS = 10.0, 18
DEGREE = math.radians(1)
WIDTH = 2 * math.pi / BEAMS
ABSENT, PRESENT = (1.05, 0.25), (2.2, 0.7)
"""Mean and deviation of a beam's energy in the quiet first 400 s, and roughly with a source."""

pytestmark = pytest.mark.skipif(not DATA.exists(), reason="the infrasound recording is not beside the project")


@pytest.fixture(scope="module")
def found() -> SeveralEstimate:
    array = sensor_array(np.array(PLACES), sound_speed=345.0)
    analysis = {"band": [0.5, 2.5], "frame": FRAME, "beams": BEAMS}
    record = beamformed(read(*sorted(DATA.glob("*.SAC"))), array, Scenario.model_validate({"analysis": analysis}))
    energy = jnp.asarray(record.read(0, record.length)[:, None], jnp.float32)
    stands = Stations(*(jnp.zeros((record.length, 1)),) * 3)
    scans = EnergyScan(jnp.asarray(record.times, jnp.float32), energy, jnp.ones(energy.shape, bool), stands)
    fans = Fans((-math.pi,), (WIDTH,), (BEAMS,), (False,))
    tracker = bearing_tracker(
        BeamEnergies(fans, *ABSENT, *PRESENT),
        bearing=between(-math.pi, math.pi, 72),
        bearing_rate=between(-0.3 * DEGREE, 0.3 * DEGREE, 5),
        rate_noise=0.02 * DEGREE,
        interval=FRAME,
        arrival_rate=1e-3,
        departure_rate=5e-3,
        slots=4,
        particles=1024,
        hold=2,
        margin=2,  # the array is a wavelength across: one source raises five beams
    )
    return tracker.steps(tracker.init(jax.random.key(0)), scans, jax.random.key(1))[1]


@pytest.mark.parametrize(
    ("label", "start", "end", "bearing"), [(1, 640, 800, -110), (2, 840, 930, -39)], ids=["west", "northwest"]
)
def test_each_source_is_one_target(
    found: SeveralEstimate, label: int, start: float, end: float, bearing: float
) -> None:
    """Held all the while that it is loud, on average within half a beam of the published bearing."""
    scan, slot = np.nonzero(np.asarray(found.label) == label)
    time = np.asarray(found.time)[scan]
    assert time[0] < start
    assert time[-1] > end
    held = np.degrees(np.asarray(found.mean.bearing)[scan, slot])
    print(f"{time[0]:.0f} to {time[-1]:.0f} s: {held.mean():.1f} degrees, standard deviation {held.std():.1f}")
    assert abs(held.mean() - bearing) < np.degrees(WIDTH) / 2
    assert np.abs(held - bearing).max() < np.degrees(WIDTH)


def test_nothing_else_is_declared(found: SeveralEstimate) -> None:
    assert np.asarray(found.label).max() == 2
