"""Audio files: WAV (RIFF, RIFX, RF64), Wave64, AIFF, CAF and FLAC.

Integer samples come scaled to -1 to 1, float samples as they stand. Plain samples are read where they stand
(`faintrack.io.containers`), packed ones and FLAC by libsndfile. None of the formats says what its channels are called;
when a recording began, WAV may say (`bext`, iXML). How many samples there are is never believed before it is seen.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import reader, require_channels, require_file, require_rate
from faintrack.io.containers import Container, read_container
from faintrack.io.flac import Patched, true_length

SUFFIXES = (".wav", ".flac", ".w64", ".rf64", ".bwf", ".aif", ".aiff", ".aifc", ".caf")

# Samples of one frame, and the bytes of the shortest one that can hold them.
_LARGEST_FLAC_FRAME, _SMALLEST_FLAC_FRAME = 65535, 10


@reader("")
def open_audio(path: Path) -> Recording:
    """Recording of an audio file; float32 samples, or float64 where the file has them.

    Raises
    ------
    InputError : no such file, none of these formats, or fewer samples than the header promises.
    """
    require_file(path)
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(4) == b"fLaC":
            return _flac(path, size)
        container = read_container(path, file, size)
    if container is not None and container.kind is not None:
        return _plain(path, container)
    return _decoded(path, container)


def _plain(path: Path, container: Container) -> Recording:
    together = container.channels * container.width

    def read_samples(start: int, stop: int) -> np.ndarray:
        with path.open("rb") as file:
            file.seek(container.start + start * together)
            content = np.fromfile(file, np.uint8, (stop - start) * together)
        if content.size < (stop - start) * together:
            raise InputError(f"{path} ends before sample {stop} of {container.length}.")
        return container.decode(content)

    return Recording(
        read_samples,
        container.length,
        container.rate,
        _numbered(container.channels),
        container.start_time,
        str(path),
        container.remarks,
    )


def _flac(path: Path, size: int) -> Recording:
    promised, found = true_length(path)
    if found is None and promised == 0:
        raise InputError(f"{path} does not tell its length, and its last frame is damaged or cut short.")
    if found is not None and 0 < found < promised:
        raise InputError(f"{path} holds {found} of the {promised} samples that its header promises.")
    length = promised if found is None else found
    if length > size // _SMALLEST_FLAC_FRAME * _LARGEST_FLAC_FRAME:
        raise InputError(f"{path} tells of {length} samples, which its {size} bytes cannot hold.")
    remarks: tuple[str, ...] = ()
    if length != promised:
        told = f"tells of {promised} samples" if promised else "does not tell its length"
        remarks = (f"The header {told}; the file holds {length} samples, all of which are read.",)
    return _decoded(path, None, lambda: Patched(path, length), remarks)


def _decoded(
    path: Path,
    container: Container | None,
    opened: Callable[[], object] | None = None,
    remarks: tuple[str, ...] = (),
) -> Recording:
    """Recording that libsndfile decodes."""
    import soundfile

    source: Callable[[], object] = opened or (lambda: path)
    with soundfile.SoundFile(source()) as file:
        length, rate, channels = file.frames, float(file.samplerate), file.channels
        require_channels(channels, path)
        require_rate(rate, path)
        if length > limits.MOST_SAMPLES:
            raise InputError(f"{path} tells of {length} samples; expected at most {limits.MOST_SAMPLES}.")
        # The last sample cannot be decoded from a file that was cut short.
        if length:
            file.seek(length - 1)
            if len(file.read(1)) != 1:
                raise InputError(f"{path} ends before the {length} samples that its header promises.")

    def read_samples(start: int, stop: int) -> np.ndarray:
        with soundfile.SoundFile(source()) as file:
            file.seek(start)
            samples = file.read(stop - start, dtype="float32", always_2d=True)
        if len(samples) < stop - start:
            raise InputError(f"{path} ends before sample {stop} of {length}.")
        return samples

    if container is not None:
        remarks = (*container.remarks, *remarks)
    start_time = None if container is None else container.start_time
    return Recording(read_samples, length, rate, _numbered(channels), start_time, str(path), remarks)


def _numbered(channels: int) -> tuple[str, ...]:
    return tuple(str(number) for number in range(channels))
