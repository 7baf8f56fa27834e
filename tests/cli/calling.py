"""Calls of the command line within the test's own process."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from unittest import mock

from faintrack.cli import main

SCENARIO = """
[array]
line = {count = 8, spacing = 0.75}

[analysis]
beams = 180

[simulation]
duration = 40.0
sample_rate = 1000.0
sources = [{snr_db = -14.0, bearing_deg = 60.0, start = 10.0}]
"""


@dataclass(frozen=True)
class Done:
    """What a call left: exit status, standard output, standard error."""

    status: int
    out: str
    err: str


def call(*arguments: object) -> Done:
    """Run `faintrack` with these arguments."""
    out, err = io.StringIO(), io.StringIO()
    status = 0
    with (
        mock.patch.object(sys, "argv", ["faintrack", *map(str, arguments)]),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
    return Done(status, out.getvalue(), err.getvalue())
