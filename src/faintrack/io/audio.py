"""WAV and FLAC files, read by libsndfile.

Integer samples come scaled to -1 to 1, float samples as they stand. Neither format says when the recording
began nor what its channels are called.
"""

import struct
from io import BufferedIOBase
from pathlib import Path

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.checks import explained, require_file

# A writer that does not know the length beforehand (a pipe) leaves one of these in the header.
_UNKNOWN_SIZES = (0, 0xFFFFFFFF)


def open_audio(path: Path) -> Recording:
    """Recording of a WAV (also RF64) or FLAC file; float32 samples.

    Raises
    ------
    InputError : no such file, not WAV or FLAC, or fewer samples than the header promises.
    """
    import soundfile

    require_file(path)
    complaint = f"{path} cannot be read as {path.suffix[1:].upper()}"
    with explained(complaint):
        _require_whole(path)
        with soundfile.SoundFile(path) as file:
            length, rate, channels = file.frames, float(file.samplerate), file.channels
            # The last sample cannot be decoded from a FLAC file that was cut short.
            if length:
                file.seek(length - 1)
                if len(file.read(1)) != 1:
                    raise InputError(f"{path} ends before the {length} samples that its header promises.")

    def read_samples(start: int, stop: int) -> np.ndarray:
        with explained(complaint), soundfile.SoundFile(path) as file:
            file.seek(start)
            return file.read(stop - start, dtype="float32", always_2d=True)

    return Recording(read_samples, length, rate, tuple(str(i) for i in range(channels)), source=str(path))


def data_chunk(file: BufferedIOBase) -> tuple[int, int] | None:
    r"""Place of the samples in a RIFF or RF64 file: first byte and number of bytes, None where there are none.

    Parameters
    ----------
    file : opened for reading; left at any position.

    Examples
    --------
    >>> import io
    >>> data_chunk(io.BytesIO(b"RIFF\x10\0\0\0WAVEdata\x04\0\0\0" + bytes(4)))
    (20, 4)
    """
    file.seek(12)
    long_size = None
    while len(head := file.read(8)) == 8:
        name, size = struct.unpack("<4sI", head)
        if name == b"data":
            return file.tell(), size if long_size is None else long_size
        start = file.tell()
        if name == b"ds64":
            long_size = struct.unpack("<8xQ", file.read(16))[0]
        file.seek(start + size + size % 2)
    return None


def _require_whole(path: Path) -> None:
    """Refuse a RIFF file that ends before its header says; libsndfile would shorten it in silence."""
    with path.open("rb") as file:
        if file.read(4) not in (b"RIFF", b"RF64"):
            return
        chunk = data_chunk(file)
    if chunk is None:
        raise InputError(f"{path} ends before its samples begin.")
    start, promised = chunk
    held = path.stat().st_size - start
    if promised not in _UNKNOWN_SIZES and held < promised:
        raise InputError(f"{path} holds {held} of the {promised} bytes of samples that its header promises.")
