"""Recordings: samples of the channels of one array, tracked in bearing.

Frames of samples are beamformed (`faintrack.signal.beamformer`), a likelihood reads the beam powers, and a Bernoulli
filter with particles follows one source at a time in bearing, bearing rate and SNR.
"""

from pathlib import Path

import numpy as np

from faintrack.data.recording import Recording
from faintrack.kinds.kind import Kind
from faintrack.kinds.recording.sections import RecordingScenario
from faintrack.kinds.rooms import room


def _holds(paths: tuple[Path, ...]) -> bool:
    from faintrack.io.audio import SUFFIXES

    suffixes = (*SUFFIXES, ".sac", ".mseed", ".miniseed", ".ms")
    if all(path.suffix.lower() in suffixes for path in paths):
        return True
    return len(paths) == 1 and paths[0].suffix.lower() in (".h5", ".hdf5", ".zarr") and _has_samples(paths[0])


def _has_samples(path: Path) -> bool:
    """Whether HDF5 or Zarr is in Acoular's layout."""
    from faintrack.io.variables import open_hdf5, open_zarr

    open_file = open_zarr if path.suffix.lower() == ".zarr" else open_hdf5
    return "time_data" in open_file(path)


def _read(paths: tuple[Path, ...], scenario: RecordingScenario | None) -> Recording:
    from faintrack.io.recordings import read

    return read(*paths, start_pattern=None if scenario is None else scenario.files.start_pattern)


def _write(path: Path, recording: Recording) -> None:
    from faintrack.io.write_recordings import write_recording

    blocks = recording.blocks(max(1, 2**20 // recording.channels))
    write_recording(path, blocks, recording.sample_rate, recording.channel_names, recording.start_time)


def _describe(recording: Recording) -> dict[str, str]:
    first = np.asarray(recording.read(0, min(recording.length, round(recording.sample_rate))), float)
    level = np.sqrt(np.nanmean(first**2))
    names = ", ".join(recording.channel_names[:8]) + (" ..." if recording.channels > 8 else "")
    start = recording.start_time
    return {
        "holds": f"a recording of {recording.channels} channels",
        "channels": names,
        "sample rate": f"{recording.sample_rate:g} Hz",
        "span": f"{recording.duration:g} s, {recording.length} samples a channel",
        "start": "not known" if start is None else f"{start}Z",
        "level": f"{level:.3g} root mean square in the first second",
    }


KIND = Kind(
    name="recording",
    title="Recording of an array",
    scenario=RecordingScenario,
    data=Recording,
    holds=_holds,
    read=_read,
    write=_write,
    plan=room("faintrack.kinds.recording.plan", "plan"),
    simulate=room("faintrack.kinds.recording.simulate", "simulate"),
    targets=room("faintrack.kinds.recording.simulate", "targets"),
    silence=room("faintrack.kinds.recording.simulate", "silence"),
    describe=_describe,
    about=room("faintrack.kinds.recording.report", "about"),
    draw=room("faintrack.kinds.recording.pictures", "draw"),
    shown="Record, existence, SNR",
    calibrate=room("faintrack.kinds.recording.calibration", "calibrate"),
    needs=("--array FILE",),
    surrogate=room("faintrack.kinds.recording.quiet", "surrogate"),
    stretch=room("faintrack.kinds.stretches", "of_recording"),
    gained=room("faintrack.kinds.recording.quiet", "gained"),
)
