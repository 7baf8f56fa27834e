"""What a field of a scenario means, said from the very sections that validate it."""

import difflib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from faintrack.errors import InputError
from faintrack.kinds import kinds
from faintrack.kinds.commented import default_of, texts_of
from faintrack.scenario.section import models_of

UNITS = {"_deg": "degree", "_db": "dB", "_deg_s": "degree/s", "_hz": "Hz"}
"""What the end of a name tells; of other names the meaning says it."""

_BOUNDS = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below", "min_length": "length at least"}
_BOUNDS["max_length"] = "length at most"


@dataclass(frozen=True)
class Explanation:
    """What is known of a field.

    Attributes
    ----------
    field : its sections and its name, with dots.
    kinds : of data whose scenarios have it so.
    meaning : of it, as the documentation of its section says; a sentence or several.
    unit : where the name tells it; empty otherwise.
    values : what it may be: bounds, or the words that are known; empty where anything of its type may stand.
    default : as TOML; empty where there is none and data or other fields decide.
    required : whether it must be given.
    """

    field: str
    kinds: tuple[str, ...]
    meaning: str
    unit: str
    values: str
    default: str
    required: bool


def explain(name: str) -> list[Explanation]:
    """What is known of a field: one entry for each meaning that it has in the kinds of data.

    Parameters
    ----------
    name : of a field, with its section or without, or of a section, whose fields are then all explained.

    Raises
    ------
    InputError : there is no such field.

    Examples
    --------
    >>> one = explain("tracker.declare")[0]
    >>> one.values, one.default, one.meaning[:28]
    ('above 0, below 1', '0.97', 'existence at which a track b')
    """
    entries: dict[tuple[str, str, str, str], Explanation] = {}
    paths: set[str] = set()
    for kind in kinds():
        for entry in _entries(kind.scenario, ""):
            paths.add(entry.field)
            if not _asked(name, entry.field):
                continue
            key = entry.field, entry.meaning, entry.values, entry.default
            known = entries[key].kinds if key in entries else ()
            entries[key] = Explanation(**{**entry.__dict__, "kinds": (*known, kind.name)})
    if not entries:
        words = paths | {part for path in paths for part in path.split(".")}
        near = difflib.get_close_matches(name, sorted(words), 1, cutoff=0.6)
        hint = f"; did you mean {near[0]}?" if near else "; faintrack init KIND prints all of a kind."
        raise InputError(f"there is no field {name}{hint}")
    return sorted(entries.values(), key=lambda entry: entry.field.count("."))


def field_names() -> list[str]:
    """All fields of all kinds, with their sections."""
    return sorted({entry.field for kind in kinds() for entry in _entries(kind.scenario, "")})


def _asked(name: str, path: str) -> bool:
    """Whether a path is the field of this name, or stands in the section of this name."""
    return path == name or path.endswith(f".{name}") or path.startswith(f"{name}.")


def _entries(model: type[BaseModel], above: str) -> Iterator[Explanation]:
    """Every field within a section."""
    texts = texts_of(model)
    for name, field in model.model_fields.items():
        inner = list(models_of(field.annotation))
        if inner and (not above or not texts.get(name)):
            yield from _entries(inner[0], f"{above}{name}.")
            continue
        yield Explanation(
            field=above + name,
            kinds=(),
            meaning=texts.get(name, ""),
            unit=next((unit for end, unit in UNITS.items() if name.endswith(end)), ""),
            values=", ".join([*_words(field.annotation), *_bounds(field)]),
            default=default_of(field),
            required=field.is_required(),
        )
        if inner:
            yield from _entries(inner[0], f"{above}{name}.")


def _words(annotation: Any) -> list[str]:
    """Values of a literal."""
    if get_origin(annotation) is Literal:
        return [str(value) for value in get_args(annotation)]
    return [word for part in get_args(annotation) for word in _words(part)]


def _bounds(field: FieldInfo) -> Iterator[str]:
    """Bounds of a value, and of each of several."""
    for bound in field.metadata:
        for attribute, words in _BOUNDS.items():
            limit = getattr(bound, attribute, None)
            if isinstance(limit, int | float):
                yield f"{words} {limit:g}"
