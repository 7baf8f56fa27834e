"""`faintrack lofar` and `faintrack demon`: a table of lines, and a picture, lines and levels in a folder."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from faintrack import from_samples
from faintrack.io import write_recording
from tests.cli.calling import call


@pytest.fixture(scope="module")
def ship(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Noise of 40 s that a propeller of 5 Hz modulates, with a tone of 80 Hz; another channel is quiet."""
    path = tmp_path_factory.mktemp("lines") / "ship.h5"
    time = np.arange(40_000) / 1000.0
    noise = np.random.default_rng(0).normal(size=(40_000, 2))
    heard = noise[:, 0] * (1 + 0.4 * np.cos(2 * np.pi * 5.0 * time)) + 0.3 * np.sin(2 * np.pi * 80.0 * time)
    recording = from_samples(np.stack([heard, noise[:, 1]], axis=1), 1000.0)
    write_recording(path, recording.blocks(10_000), 1000.0)
    return path


def test_lines_are_listed_drawn_and_kept(ship: Path, tmp_path: Path) -> None:
    done = call("lofar", ship, "--resolution", 1, "--out", tmp_path / "lofar")
    assert done.status == 0, done.err
    assert "1 lines above" in done.out
    with (tmp_path / "lofar" / "lines.csv").open() as file:
        (line,) = csv.DictReader(file)
    assert abs(float(line["frequency_hz"]) - 80.0) < 0.1
    assert line["fundamental_hz"] == ""
    assert (tmp_path / "lofar" / "picture.png").stat().st_size > 10_000
    with np.load(tmp_path / "lofar" / "record.npz") as record:
        assert record["level_db"].shape == (len(record["time"]), len(record["frequency"]))


def test_the_envelope_of_one_channel(ship: Path) -> None:
    options = ("--band", 120, 430, "--highest", 40, "--resolution", 0.25, "--json")
    found = json.loads(call("demon", ship, *options, "--channel", 0).out)["lines"]
    assert abs(found[0]["frequency"] - 5.0) < 0.05
    assert json.loads(call("demon", ship, *options, "--channel", 1).out)["lines"] == []


def test_what_cannot_be_is_one_sentence(ship: Path) -> None:
    for arguments, says in (
        (("lofar", ship, "--channel", "9"), "there is no channel '9'; expected one of 0, 1."),
        (("lofar", ship, "--band", 0, 900), "the band goes from 0 to 900 Hz"),
        (("demon", ship, "--highest", 900), "rates up to 900 Hz are looked for"),
        (("demon", ship.with_name("none.wav")), "none.wav does not exist."),
    ):
        done = call(*arguments)
        assert done.status == 2
        assert says in done.err
