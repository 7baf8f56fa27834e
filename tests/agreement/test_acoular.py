"""Beam power of 56 microphones in a wind tunnel is that of Acoular's conventional beamformer."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.sensors.array import sensor_array
from faintrack.signal.beamformer import beamformer
from tests.scenes import part
from tests.tolerances import FAR, rounding

FOLDER = Path(__file__).parents[2].parent / "shared/data/acoular_airfoil_56ch"
BAD = [1, 7]
"""Channels that are left out on both sides."""
BLOCK, SOUND_SPEED = 128, 343.0
BINS = [2, 5, 10, 20, 40]
"""From 800 to 16,000 Hz."""


@pytest.mark.filterwarnings("ignore")
def test_beam_power(float64: type) -> None:
    r"""Eight bearings in the plane of the array, five frequencies, 200 snapshots.

    Acoular's spectra are one-sided powers, :math:`C = \frac{2}{N^2 K} \sum_k X_k X_k^*` with unnormalised transforms X,
    and its classic steering vector is the phase over M: its map is :math:`\frac{2}{N K M^2}` times our beam power.
    """
    acoular = pytest.importorskip("acoular")
    if not FOLDER.is_dir():
        pytest.skip("../shared/data/acoular_airfoil_56ch is absent")

    source = acoular.MaskedTimeSamples(file=FOLDER / "example_data.h5", invalid_channels=BAD)
    microphones = acoular.MicGeom(file=FOLDER / "array_56.xml", invalid_channels=BAD)
    array = sensor_array(microphones.pos.T, SOUND_SPEED)
    rate, samples = source.sample_freq, next(source.result(source.num_samples))
    snapshots = source.num_samples // BLOCK
    plan = beamformer(array, rate, snapshots * BLOCK / rate, beams=24, snapshot=BLOCK / rate, dtype=float64)
    usable = jnp.ones((1, source.num_channels), bool)
    scan = part(plan.scan(jnp.zeros(1), jnp.asarray(samples[None], float64), usable), 0)
    ours = np.asarray(scan.beam_power)[:, ::3]

    class Phases(acoular.SteeringVector):
        """Acoular's steering vector by the path that keeps it whole: its fast one rounds k r to single precision."""

    bearing = plan.grid.bearing[::3]
    places = FAR * np.stack([np.sin(bearing), np.cos(bearing), np.zeros(bearing.size)])
    steering = Phases(
        grid=acoular.ImportGrid(pos=places),
        mics=microphones,
        env=acoular.Environment(c=SOUND_SPEED),
        steer_type="classic",
    )
    spectra = acoular.PowerSpectra(source=source, block_size=BLOCK, window="Rectangular", overlap="None", cached=False)
    conventional = acoular.BeamformerBase(freq_data=spectra, steer=steering, r_diag=False, cached=False)
    size = np.linalg.norm(array.positions, axis=1).max()
    for number in BINS:
        frequency = plan.grid.frequency[number - 1]
        theirs = conventional.synthetic(frequency, 0) * BLOCK * snapshots * len(array.positions) ** 2 / 2
        # A phase off by e changes the sum over channels by e sqrt(M E) at most, and its square by twice that.
        phase = 2 * np.pi * frequency / SOUND_SPEED * size**2 / (2 * FAR)
        most = len(array.positions) * float(scan.total_power[number - 1])
        np.testing.assert_allclose(ours[number - 1], theirs, rtol=rounding(float64, 1000), atol=2 * phase * most)
