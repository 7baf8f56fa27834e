"""Recordings in an object store: S3 as moto speaks it, on this machine alone."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyarrow")
pytest.importorskip("s3fs")
pytest.importorskip("moto.server")

from faintrack.archive.cut import Cut, chains_of
from faintrack.archive.pieces import laid, pieces_of
from faintrack.archive.samples import Samples, Unreadable
from faintrack.archive.sources import sources_of
from faintrack.io.write_recordings import write_recording


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    import s3fs
    from moto.server import ThreadedMotoServer

    running = ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    running.start()
    host, port = running.get_host_and_port()
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "none")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    s3fs.S3FileSystem.clear_instance_cache()
    s3fs.S3FileSystem().mkdir("archive")
    yield "s3://archive"
    s3fs.S3FileSystem.clear_instance_cache()
    running.stop()


def test_recordings_in_an_object_store(bucket: str, tmp_path: Path) -> None:
    import s3fs

    samples = np.random.default_rng(0).normal(size=(200_000, 4)).astype(np.float32)
    for number in range(2):
        file = tmp_path / f"20260101_0000{20 * number:02}.wav"
        write_recording(file, [samples[100_000 * number : 100_000 * (number + 1)]], 5000.0)
        s3fs.S3FileSystem().put_file(str(file), f"archive/north/{file.name}")
    sources, _ = sources_of([bucket], "{station}/%Y%m%d_%H%M%S")
    pieces, left_out = pieces_of(sources, {}, {})
    assert not left_out
    assert [(piece.station, piece.length) for piece in pieces] == [("north", 100_000)] * 2
    ((segment,),) = chains_of(laid(pieces)[0], Cut(), 1.0)
    with Samples(segment) as held:
        np.testing.assert_array_equal(held.recording().read(99_000, 101_000), samples[99_000:101_000])
        held.require_unchanged()
    s3fs.S3FileSystem().rm_file("archive/north/20260101_000020.wav")
    s3fs.S3FileSystem().invalidate_cache()
    with Samples(segment) as held, pytest.raises(Unreadable, match="vanished"):
        held.recording().read(99_000, 101_000)
