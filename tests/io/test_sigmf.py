"""SigMF: real samples as they stand, complex ones refused, and no description believed that makes no sense."""

import json

import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.io import read

SAMPLES = np.random.default_rng(2).integers(0, 100, (50, 3))


def saved(folder, kind="ri16_le", samples=SAMPLES, dtype="<i2", **changed):
    told = {"core:datatype": kind, "core:sample_rate": 2000, "core:num_channels": 3} | changed
    told = {key: value for key, value in told.items() if value is not None}
    captures = [{"core:sample_start": 0, "core:datetime": "2024-02-29T12:00:00.5Z"}]
    (folder / "a.sigmf-meta").write_text(json.dumps({"global": told, "captures": captures, "annotations": []}))
    (folder / "a.sigmf-data").write_bytes(samples.astype(dtype).tobytes())
    return folder / "a.sigmf-meta"


@pytest.mark.parametrize(
    ("kind", "dtype"), [("ri16_le", "<i2"), ("ri16_be", ">i2"), ("ru8", "u1"), ("rf32_le", "<f4"), ("rf64_be", ">f8")]
)
def test_real_samples(tmp_path, kind, dtype):
    recording = read(saved(tmp_path, kind, dtype=dtype))
    np.testing.assert_array_equal(recording.read(0, 50), SAMPLES)
    np.testing.assert_array_equal(read(tmp_path / "a.sigmf-data").read(20, 31), SAMPLES[20:31])
    assert (recording.sample_rate, str(recording.start_time)) == (2000.0, "2024-02-29T12:00:00.500000000")


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"core:datatype": "cf32_le"}, "need a beamformer of both sides of the spectrum"),
        ({"core:datatype": "rf8"}, "expected such as rf32_le"),
        ({"core:datatype": None}, "core:datatype is 'None'"),
        ({"core:sample_rate": None}, "core:sample_rate is 'None'; expected Hz"),
        ({"core:sample_rate": 0}, "expected a number above 0 Hz"),
        ({"core:sample_rate": 1e300}, "the sample rate is 1e"),
        ({"core:num_channels": 10**9}, "has 1000000000 channels"),
        ({"core:num_channels": -1}, "expected 1 or more"),
        ({"core:dataset": "/etc/passwd"}, "expected plain ones"),
    ],
)
def test_descriptions_that_make_no_sense(tmp_path, changed, expected):
    path = saved(tmp_path)
    told = json.loads(path.read_text())
    told["global"] |= changed
    told["global"] = {key: value for key, value in told["global"].items() if value is not None}
    path.write_text(json.dumps(told))
    with pytest.raises(InputError, match=expected):
        read(path)


def test_json_without_end(tmp_path):
    path = saved(tmp_path)
    path.write_text("[" * 200_000)
    with pytest.raises(InputError, match="cannot be read as SigMF"):
        read(path)
