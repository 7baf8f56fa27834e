"""Detectors spread over two devices against one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import dataclasses
import jax, numpy as np
from faintrack.trackers.detectors import shared_among
from tests.region import paths, scans, tracker

assert len(jax.devices()) == 2
data = jax.tree.map(lambda values: values[:12], scans(0, paths((-200.0, -150.0, 3.0, 2.0))))
start = tracker().init(jax.random.key(0))
spread = dataclasses.replace(start, beliefs=(shared_among(start.beliefs[0], jax.devices()),))
key = jax.random.key(1)
one, (many, said) = tracker().steps(start, data, key)[1], tracker().steps(spread, data, key)
assert len(many.beliefs[0].log_weights.sharding.device_set) == 2, many.beliefs[0].log_weights.sharding
np.testing.assert_allclose(one.detection, said.detection, rtol=1e-4, atol=1e-6)
print("same")
"""


@pytest.mark.slow
def test_two_devices_say_what_one_says() -> None:
    """Sums are rounded in another order: to a thousand units of the last place."""
    environment = {**os.environ, "XLA_FLAGS": "--xla_force_host_platform_device_count=2"}
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, cwd=root, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "same", done.stderr
