"""SigMF recordings: a description in JSON (`.sigmf-meta`) beside the samples (`.sigmf-data`).

Real samples of any width and byte order, channels side by side. Complex ones, which software radios give, are refused
with a sentence: what tracks them needs both sides of the spectrum.
"""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import reader, require_channels, require_file, require_rate, utc

_KIND = re.compile(r"([rc])([fiu])(8|16|32|64)(_le|_be)?")


@reader("SigMF")
def open_sigmf(path: Path) -> Recording:
    """Recording of a SigMF description and the samples beside it; as they stand, float32 or float64.

    Parameters
    ----------
    path : of either file.

    Raises
    ------
    InputError : one of both is missing or damaged, samples are complex, or the description does not fit.
    """
    meta, data = path.with_suffix(".sigmf-meta"), path.with_suffix(".sigmf-data")
    require_file(meta)
    require_file(data)
    if meta.stat().st_size > limits.LARGEST_TEXT:
        raise InputError(f"{meta} has {meta.stat().st_size} bytes; expected at most {limits.LARGEST_TEXT}.")
    told = json.loads(meta.read_text(encoding="utf-8"))
    common: Any = told.get("global") if isinstance(told, dict) else None
    if not isinstance(common, dict):
        raise InputError(f"{meta} has no object global.")
    kind = _KIND.fullmatch(str(common.get("core:datatype"))[:20])
    if kind is None:
        raise InputError(
            f"{meta}: core:datatype is {str(common.get('core:datatype'))[:40]!r}; expected such as rf32_le."
        )
    if kind[1] == "c":
        raise InputError(
            f"{meta}: core:datatype is {kind[0]}; expected real samples. Complex samples of coherent receivers need a "
            "beamformer of both sides of the spectrum, which there is not yet."
        )
    if kind[2] == "f" and kind[3] == "8":
        raise InputError(f"{meta}: core:datatype is {kind[0]}; expected such as rf32_le.")
    dtype = np.dtype(f"{'>' if kind[4] == '_be' else '<'}{kind[2]}{int(kind[3]) // 8}")
    rate, channels = common.get("core:sample_rate"), common.get("core:num_channels", 1)
    if isinstance(rate, bool) or not isinstance(rate, int | float):
        raise InputError(f"{meta}: core:sample_rate is {str(rate)[:40]!r}; expected Hz.")
    if type(channels) is not int or channels < 1:
        raise InputError(f"{meta}: core:num_channels is {str(channels)[:40]!r}; expected 1 or more.")
    require_channels(channels, meta)
    if common.get("core:dataset") or common.get("core:trailing_bytes"):
        raise InputError(f"{meta} tells of samples in a file of another layout; expected plain ones.")
    length, rest = divmod(data.stat().st_size, dtype.itemsize * channels)
    captures = told.get("captures") or [{}]
    first = captures[0] if isinstance(captures, list) and isinstance(captures[0], dict) else {}
    if any(isinstance(each, dict) and each.get("core:header_bytes") for each in captures):
        raise InputError(f"{meta} tells of headers between samples; expected plain ones.")
    start = first.get("core:datetime")
    remarks: tuple[str, ...] = (f"The file ends within a sample; its last {rest} bytes are left out.",) if rest else ()
    if len(captures) > 1:
        remarks += (f"The file has {len(captures)} captures; they are taken as one without gaps.",)

    def read_samples(begin: int, end: int) -> np.ndarray:
        with data.open("rb") as file:
            file.seek(begin * channels * dtype.itemsize)
            values = np.fromfile(file, dtype, (end - begin) * channels)
        return values.reshape(-1, channels).astype(np.float64 if dtype.itemsize == 8 and kind[2] == "f" else np.float32)

    return Recording(
        read_samples,
        length,
        require_rate(float(rate), meta),
        tuple(str(number) for number in range(channels)),
        None if start is None else utc(str(start), f"{meta}: core:datetime"),
        str(path),
        remarks,
    )
