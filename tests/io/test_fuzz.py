"""A thousand damaged files of each kind: a result or a sentence, within bounds of time and memory.

Small files that are right are changed in bytes, in length and in structure (fields that hold lengths, counts and types
get the ends of their ranges), and read whole in a process of their own that may take 10 s of its processor a file and
1.5 GB. One process reads many files, as long as it lives; a file at which it dies or hangs is found by name.
"""

import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import soundfile
import tifffile
import zarr
from PIL import Image

import faintrack

MUTANTS = int(os.environ.get("FAINTRACK_MUTANTS", "1000"))
SEED = int(os.environ.get("FAINTRACK_SEED", "0"))
SECONDS, BYTES = 10, 1_500_000_000
NOISE = np.random.default_rng(0).integers(-1000, 1000, (300, 3))
FRAMES = np.random.default_rng(0).integers(0, 200, (6, 8, 9)).astype(np.uint8)
EXTREMES = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**63 - 1, 2**64 - 1)


def audio(path: Path, kind: str, **options: object) -> None:
    soundfile.write(path, NOISE / 2**15, 2000, subtype=kind, **options)


def seismic(path: Path, kind: str, **options: object) -> None:
    obspy = pytest.importorskip("obspy")
    header = {"station": "A", "network": "XX", "channel": "BDF", "sampling_rate": 100.0}
    traces = [
        obspy.Trace(NOISE[:, n].astype(options.pop("dtype", np.int32)), header | {"location": f"0{n}"})
        for n in range(2)
    ]
    (obspy.Stream(traces) if kind == "MSEED" else traces[0]).write(str(path), format=kind, **options)


def hdf5(path: Path, **options: object) -> None:
    with h5py.File(path, "w") as file:
        dataset = file.create_dataset("time_data", data=NOISE.astype(np.float32), **options)
        dataset.attrs.update({"sample_freq": 100.0, "channel_names": ["a", "b", "c"], "start_time": "2024-02-29"})


def zarr_recording(path: Path, version: int) -> None:
    group = zarr.open_group(path, mode="w", zarr_format=version, attributes={"sample_rate": 100.0})
    group.create_array("time_data", shape=NOISE.shape, chunks=(100, 3), dtype="f4")[:] = NOISE


def pngs(path: Path, kind: str = "png") -> None:
    path.mkdir()
    for number, frame in enumerate(FRAMES[:3]):
        Image.fromarray(frame).save(path / f"frame_{number}.{kind}")


def pages(path: Path, **options: object) -> None:
    with tifffile.TiffWriter(path) as file:
        for frame in FRAMES:
            file.write(frame, contiguous=False, photometric="minisblack", **options)


def tiff(path: Path, **options: object) -> None:
    tifffile.imwrite(path, FRAMES, metadata={"axes": "TYX"}, **options)


def sigmf(path: Path) -> None:
    path.mkdir()
    told = {"global": {"core:datatype": "ri16_le", "core:sample_rate": 100, "core:num_channels": 3}, "captures": []}
    (path / "a.sigmf-meta").write_text(json.dumps(told))
    (path / "a.sigmf-data").write_bytes(NOISE.astype("<i2").tobytes())


def hdf5_frames(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("f", data=FRAMES, chunks=(1, 8, 9))


BEARINGS = "time_s,bearing_deg,observer_x_m,observer_y_m"
MICROPHONES = "<MicArray><pos Name='a' x='0' y='0' z='0'/><pos Name='b' x='1' y='0' z='0'/></MicArray>"


def text(content: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(content, encoding="utf-8")


KINDS: dict[str, tuple[str, str, Callable[[Path], object]]] = {
    "WAV": ("read", "a.wav", lambda p: audio(p, "PCM_16")),
    "WAV float": ("read", "a.wav", lambda p: audio(p, "FLOAT", format="WAVEX")),
    "WAV packed": ("read", "a.wav", lambda p: audio(p, "ULAW")),
    "RF64": ("read", "a.wav", lambda p: audio(p, "PCM_24", format="RF64")),
    "W64": ("read", "a.w64", lambda p: audio(p, "PCM_16", format="W64")),
    "AIFF": ("read", "a.aif", lambda p: audio(p, "PCM_24", format="AIFF")),
    "CAF": ("read", "a.caf", lambda p: audio(p, "PCM_16", format="CAF")),
    "FLAC": ("read", "a.flac", lambda p: audio(p, "PCM_16")),
    "HDF5": ("read", "a.h5", hdf5),
    "HDF5 packed": ("read", "a.h5", lambda p: hdf5(p, chunks=(50, 3), compression="gzip", shuffle=True)),
    "Zarr 3": ("read", "a.zarr", lambda p: zarr_recording(p, 3)),
    "Zarr 2": ("read", "a.zarr", lambda p: zarr_recording(p, 2)),
    "SAC": ("read", "a.sac", lambda p: seismic(p, "SAC", dtype=np.float32)),
    "miniSEED": ("read", "a.mseed", lambda p: seismic(p, "MSEED", reclen=512)),
    "miniSEED Steim 1": ("read", "a.mseed", lambda p: seismic(p, "MSEED", reclen=256, encoding="STEIM1")),
    "npz": ("read_sequence", "a.npz", lambda p: np.savez(p, frames=FRAMES, time=np.arange(6.0))),
    "npz packed": ("read_sequence", "a.npz", lambda p: np.savez_compressed(p, frames=FRAMES, time=np.arange(6.0))),
    "npy": ("read_sequence", "a.npy", lambda p: np.save(p, FRAMES)),
    "MAT": ("read_sequence", "a.mat", lambda p: scipy.io.savemat(p, {"f": FRAMES, "s": {"b": np.arange(6.0)}})),
    "MAT packed": ("read_sequence", "a.mat", lambda p: scipy.io.savemat(p, {"f": FRAMES}, do_compression=True)),
    "MAT 4": ("read_sequence", "a.mat", lambda p: scipy.io.savemat(p, {"f": FRAMES[0]}, format="4")),
    "TIFF": ("read_sequence", "a.tif", lambda p: tifffile.imwrite(p, FRAMES, photometric="minisblack")),
    "TIFF pages": ("read_sequence", "a.tif", lambda p: pages(p, compression="zlib")),
    "TIFF ImageJ": ("read_sequence", "a.tif", lambda p: tiff(p, imagej=True)),
    "BigTIFF OME": ("read_sequence", "a.tif", lambda p: tiff(p, ome=True, bigtiff=True)),
    "PNG": ("read_sequence", "a", pngs),
    "JPEG": ("read_sequence", "a", lambda p: pngs(p, "jpg")),
    "BMP": ("read_sequence", "a", lambda p: pngs(p, "bmp")),
    "HDF5 frames": ("read_sequence", "a.h5", hdf5_frames),
    "record CSV": ("read_record", "a.csv", text("time_s,0,90,180\n0,1.5,2,0\n10,0,,0.5\n")),
    "returns CSV": ("read_returns", "a.csv", text("time_s,delay_s,bearing_deg,snr_db\n0,9.5,90,13\n180,,,\n")),
    "bearings CSV": ("read_bearings", "a.csv", text(f"{BEARINGS}\n0,41.2,0,0\n1,,10,0\n")),
    "ships CSV": ("read_ships", "a.csv", text("time,mmsi,lat,lon\n2016-01-12 13:02:11.5,235,50.77,-1.09\n")),
    "NMEA": ("read_ships", "a.nmea", text("\\c:1452603731*5C\\!AIVDM,1,1,,A,13HOI:0P0000VOHLCnHQKwvL05Ip,0*23\n")),
    "array TOML": ("read_array", "a.toml", text("sound_speed = 340.0\nline = {count = 4, spacing = 0.5}\n")),
    "SigMF": ("read_sigmf", "a", sigmf),
    "array XML": ("read_array", "a.xml", text(MICROPHONES)),
}  # fmt: skip

READING = """
import faulthandler, resource, sys, json
from pathlib import Path
import numpy as np
from faintrack.errors import InputError
from faintrack.io import read, read_array, read_bearings, read_record, read_returns, read_sequence
from faintrack.io.ais import read_ships
import h5py, obspy, scipy.io, soundfile, tifffile, zarr
own = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (BYTES + own, BYTES + own))
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
reading, folder, first = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
def read_sigmf(path):
    return read(path / "a.sigmf-meta")
def use(path):
    found = globals()[reading](path)
    if hasattr(found, "length") and hasattr(found, "read"):
        for start in sorted({0, max(found.length - 300, 0)}):
            found.read(start, min(start + 300, found.length))
while True:
    case = folder / str(first)
    if not case.is_dir():
        break
    print(first, flush=True)
    used = resource.getrusage(resource.RUSAGE_SELF)
    limit = int(used.ru_utime + used.ru_stime) + SECONDS
    resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))
    try:
        use(next(case.iterdir()))
    except InputError as error:
        said = str(error)
        if not (said.isprintable() and len(said) < 300):
            print("BAD", repr(said), flush=True)
    except BaseException as error:
        import traceback
        print("BAD", "".join(traceback.format_exception(error))[-1500:].replace(chr(10), " | "), flush=True)
    first += 1
print("END", flush=True)
"""


def changed(content: bytes, rng: np.random.Generator) -> bytes:
    """Content with something wrong in it."""
    made = bytearray(content)
    for _ in range(rng.integers(1, 4)):
        kind = rng.integers(8)
        place = (
            int(rng.integers(max(len(made), 1))) if rng.random() < 0.5 else int(rng.integers(min(len(made), 200) or 1))
        )
        if kind == 0:
            made[place : place + 1] = bytes([rng.integers(256)])
        elif kind == 1 and made:
            made[place % len(made)] ^= 1 << int(rng.integers(8))
        elif kind in (2, 3):
            width = int(rng.choice([1, 2, 4, 8]))
            value = int(EXTREMES[rng.integers(len(EXTREMES))]) % 256**width
            made[place : place + width] = value.to_bytes(width, "little" if rng.random() < 0.5 else "big")
        elif kind == 4:
            del made[place:]
        elif kind == 5:
            del made[place : place + int(rng.integers(1, 64))]
        elif kind == 6:
            made[place:place] = made[place : place + int(rng.integers(1, 200))]
        else:
            made[place:place] = rng.integers(0, 256, int(rng.integers(1, 64)), np.uint8).tobytes()
    return bytes(made)


def changed_json(content: bytes, rng: np.random.Generator) -> bytes:
    """JSON of which one value is another."""
    told = json.loads(content)
    places: list[tuple[object, object]] = []

    def walk(item: object) -> None:
        for key, value in item.items() if isinstance(item, dict) else enumerate(item) if isinstance(item, list) else ():
            places.append((item, key))
            walk(value)

    walk(told)
    if not places:
        return b"[" * int(rng.integers(1, 5000))
    item, key = places[rng.integers(len(places))]
    values = [
        None,
        0,
        -1,
        2**31,
        10**12,
        1e308,
        "",
        "x" * 500,
        [],
        {},
        [0],
        [-1, -1],
        True,
        "NaN",
        "|O",
        [[]],
        {"a": 1},
    ]
    item[key] = values[rng.integers(len(values))]  # type: ignore[index]
    return json.dumps(told).encode()


def mutants(name: str, write: Callable[[Path], object], folder: Path, count: int) -> None:
    """Folders 0, 1, ... with one changed file or folder each."""
    original = folder / "original"
    original.mkdir()
    write(original / name)
    whole = original / name
    files = sorted(file for file in whole.rglob("*") if file.is_file()) if whole.is_dir() else [whole]
    contents = {file.relative_to(original): file.read_bytes() for file in files}
    for number in range(count):
        rng = np.random.default_rng([SEED, number, len(name)])
        target = list(contents)[rng.integers(len(contents))]
        for place, content in contents.items():
            file = folder / str(number) / place
            file.parent.mkdir(parents=True, exist_ok=True)
            if place == target:
                as_json = content[:1] == b"{" and rng.random() < 0.7
                content = changed_json(content, rng) if as_json else changed(content, rng)
            file.write_bytes(content)


def outcomes(reading: str, folder: Path, count: int) -> Iterator[tuple[int, str]]:
    """Number and fault of every file that did something else than to give a result or a sentence."""
    code = READING.replace("BYTES", str(BYTES)).replace("SECONDS", str(SECONDS))
    source = str(Path(faintrack.__file__).parents[1])
    environment = dict(
        os.environ, PYTHONPATH=source, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", PYTHONWARNINGS="ignore"
    )
    first = 0
    while first < count:
        done = subprocess.run(
            [sys.executable, "-c", code, reading, str(folder), str(first)],
            capture_output=True, text=True, errors="replace", env=environment, timeout=3600,
        )  # fmt: skip
        last = first - 1
        for line in done.stdout.splitlines():
            if line.startswith("BAD"):
                yield last, line
            elif line.isdecimal():
                last = int(line)
        if done.stdout.endswith("END\n"):
            return
        yield last, f"ended with {done.returncode}: {done.stderr[-500:]}"
        first = last + 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_but_a_result_or_a_sentence(tmp_path: Path, kind: str) -> None:
    reading, name, write = KINDS[kind]
    mutants(name, write, tmp_path, MUTANTS)
    faults = list(outcomes(reading, tmp_path, MUTANTS))
    assert not faults, "\n".join(f"{number}: {fault}" for number, fault in faults[:10])


def test_an_archive_of_nothing_but_a_claim(tmp_path: Path) -> None:
    """The one that took 23.6 GB: few bytes that claim 10^9 frames; so quick that it is no slow test."""
    folder = tmp_path / "0"
    folder.mkdir()
    header = (
        b"\x93NUMPY\x01\x00\x76\x00"
        + b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 4), }".ljust(117)
        + b"\n"
    )
    with zipfile.ZipFile(folder / "a.npz", "w") as archive:
        archive.writestr("frames.npy", header)
    assert not list(outcomes("read_sequence", tmp_path, 1))
