"""Acoular's beam power, timed in an interpreter of its own.

Acoular runs on several threads only where NumPy's linear algebra was told before it was loaded to run on one. A busy
machine slows its threads more than one alone, so both are timed and the lesser time counts.
"""

import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable

import numpy as np

from faintrack.bench.beam_problem import SAMPLE_RATE, draw_frames, plan_of
from faintrack.bench.rows import timed
from faintrack.bench.sizes import Sizes
from faintrack.sensors.array import SensorArray
from faintrack.signal.beamformer import Beamformer

FAR = 3e4
"""Metres to the points that stand for directions: wavefronts bend by little more than Acoular's distances are rounded,
2 mm."""


def acoular_seconds(sizes: Sizes) -> float | None:
    """Least time from the samples of a frame to its beam power; None where Acoular is not installed."""
    if importlib.util.find_spec("acoular") is None:
        return None
    arguments = [str(value) for value in (sizes.channels, sizes.beams, sizes.repeat_seconds)]
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", __name__, *arguments],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        check=True,
        capture_output=True,
        text=True,
    )
    return float(done.stdout)


def acoular_beam_power(array: SensorArray, plan: Beamformer) -> Callable[[np.ndarray], np.ndarray]:
    """Function from the samples of one frame to its mean beam power per channel, shape (frequency, bearing)."""
    import acoular

    assert array.axis is not None, "grid points are set for a line array"
    bearing = plan.grid.bearing
    across = np.array([-array.axis[1], array.axis[0], 0.0])
    directions = np.cos(bearing)[:, None] * array.axis + np.sin(bearing)[:, None] * across
    steering = acoular.SteeringVector(
        grid=acoular.ImportGrid(pos=FAR * directions.T),
        mics=acoular.MicGeom(pos_total=array.positions.T),
        env=acoular.Environment(c=array.sound_speed),
        steer_type="classic",
    )
    first, count = plan.first_bin, plan.grid.frequency.size

    def power(samples: np.ndarray) -> np.ndarray:
        spectra = acoular.PowerSpectra(
            source=acoular.TimeSamples(data=samples, sample_freq=SAMPLE_RATE),
            block_size=plan.snapshot,
            window="Rectangular",
            precision="complex64",
            ind_low=first,
            ind_high=first + count,
            cached=False,
        )
        result = acoular.BeamformerBase(
            freq_data=spectra, steer=steering, r_diag=False, precision="float32", cached=False
        ).result
        return np.asarray(result[first : first + count])

    return power


def main(channels: int, beams: int, repeat_seconds: float) -> None:
    """Print the least time, in seconds."""
    import numba

    sizes = Sizes(channels=channels, beams=beams)
    beam_power = acoular_beam_power(*plan_of(sizes))
    samples = draw_frames(sizes)[0]
    least = []
    for threads in {1, numba.get_num_threads()}:
        numba.set_num_threads(threads)
        least.append(timed(lambda: beam_power(samples), repeat_seconds).least)
    print(min(least))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
