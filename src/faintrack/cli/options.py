"""From options of the command line to sections of a scenario."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from faintrack.errors import InputError


def sections_of(
    settings: Sequence[str] | None = None,
    kind: str | None = None,
    array: Path | None = None,
    band: tuple[float, float] | None = None,
    frame: float | None = None,
    method: str | None = None,
    heading: Path | None = None,
) -> dict[str, Any]:
    """Sections that options give, those that were not given left out.

    Parameters
    ----------
    settings : texts such as "analysis.band=[100, 1500]"; the value is TOML, or a text that is none.
    kind, array, band, frame, method, heading : options with names of their own.

    Raises
    ------
    InputError : a text is no such setting.

    Examples
    --------
    >>> sections_of(["target.departure_rate=0.01", "cells.amplitude=rayleigh"], band=(100.0, 1500.0))
    {'analysis': {'band': (100.0, 1500.0)}, 'target': {'departure_rate': 0.01}, 'cells': {'amplitude': 'rayleigh'}}
    """
    analysis = {name: value for name, value in (("band", band), ("frame", frame)) if value is not None}
    tracker = {} if method is None else {"method": method}
    named: dict[str, Any] = {"kind": kind, "array": array, "heading": heading, "analysis": analysis, "tracker": tracker}
    sections = {name: value for name, value in named.items() if value}
    for text in settings or ():
        path, equals, value = text.partition("=")
        section, dot, field = path.strip().partition(".")
        if not (equals and dot and section and field):
            raise InputError(f"--set {text}: expected SECTION.FIELD=VALUE, such as tracker.declare=0.99.")
        try:
            content = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            content = value.strip()
        sections[section] = {**sections.get(section, {}), field: content}
    return sections
