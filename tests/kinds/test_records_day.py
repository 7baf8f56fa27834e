"""A day of two arrays at one scan a second: memory does not grow, and the target is held."""

from pathlib import Path

import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.data.sequence import Sequence
from faintrack.kinds.loop import advance
from faintrack.kinds.records.data import from_records
from faintrack.kinds.records.plan import plan
from faintrack.kinds.records.sections import RecordsScenario

DAY, PLACES, STEP_DEG = 86_400, (-200.0, 400.0), 3.0
LEVEL, SPEED, NORTH, RADIUS = 3.0, 2.0, 600.0, 300.0
STATUS = Path("/proc/self/statm")
SCENARIO = RecordsScenario(
    **{
        "stations": [
            {"name": name, "x": x, "y": 0.0, "heading_deg": 90.0}
            for name, x in zip(("west", "east"), PLACES, strict=True)
        ],
        "region": {"x": [-600, 600], "y": [200, 1000], "cell": 50.0, "detectors": [2, 1], "speed": 4.0, "speeds": 3},
        "energies": {"absent": [0.0, 1.0], "present": [LEVEL, 1.0]},
        "target": {"arrival_rate": 0.001, "departure_rate": 0.0001, "velocity_noise": 0.1},
        "several": {"slots": 3, "particles": 256},
    }
)


def place(scan: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far east and north the target is, which goes in circles; m."""
    angle = SPEED / RADIUS * scan
    return RADIUS * np.cos(angle), NORTH + RADIUS * np.sin(angle)


def record(number: int) -> Sequence:
    """Energies that are drawn when they are asked for, the same for the same scans."""

    def read(start: int, stop: int) -> np.ndarray:
        scan = np.arange(start, stop)
        rows = np.stack([np.random.default_rng((number, row)).normal(size=61) for row in scan])
        east, north = place(scan)
        bearing = np.degrees(np.arctan2(north, east - PLACES[number]))
        rows[np.arange(len(scan)), np.round(bearing / STEP_DEG).astype(int)] += LEVEL
        return rows.astype(np.float32)

    return Sequence(read, np.arange(float(DAY)), (("bearing", Axis(0.0, STEP_DEG, 61)),), f"record {number}")


def resident_mib() -> float:
    """Memory of this process."""
    return int(STATUS.read_text().split()[1]) * 4096 / 2**20


@pytest.mark.slow
@pytest.mark.skipif(not STATUS.exists(), reason="memory is read as Linux tells it")
def test_a_day_takes_no_more_memory_than_its_beginning() -> None:
    early, held, error, scans = 0.0, 0, 0.0, 0
    for _, block in advance(plan(from_records((record(0), record(1))), SCENARIO)):
        label = block.label.values > 0
        held += int(label.any(axis=1).sum())
        east, north = place(scans + np.arange(len(label)))
        off = np.hypot(block.x.values - east[:, None], block.y.values - north[:, None])
        error += float(off[label].sum())
        scans += len(label)
        early = early or (resident_mib() if scans > DAY / 10 else 0.0)
    late = resident_mib()
    print(f"{early:.0f} MiB after a tenth of a day, {late:.0f} after {scans} scans; held in {held / scans:.4f} of them")
    assert scans == DAY
    assert late < early + 50
    assert held > 0.97 * scans
    assert error / held < 50  # a false track would add its own errors
