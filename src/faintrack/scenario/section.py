"""Sections of a scenario: tables of a file, validated field by field.

A section refuses what it does not know, wrong types and numbers that are not finite. It takes numbers and paths as
Python users have them: numbers and arrays of NumPy, `pathlib.Path`. `problem` turns what pydantic says into one
sentence.
"""

import difflib
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
import tomli_w
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from faintrack.errors import InputError

_KINDS = {
    "model_type": "expected a table",
    "model_attributes_type": "expected a table",
    "tuple_type": "expected a list",
    "too_short": "expected a list of {min_length} or more",
    "too_long": "expected a list of {max_length} or fewer",
}
"""What to say in TOML's words where pydantic uses Python's."""

Pair = Annotated[tuple[float, float], Field(strict=False)]
"""Two numbers, in a file a list of them."""


class Section(BaseModel):
    """A table of a scenario: unknown fields, wrong types and numbers that are not finite are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _as_in_a_file(cls, values: Any) -> Any:
        return {name: _plain(value) for name, value in values.items()} if isinstance(values, dict) else values


def _plain(value: Any) -> Any:
    """A value of NumPy or a path as a file would hold it."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def _located(value: str, info: Any) -> str:
    folder = (info.context or {}).get("folder")
    return value if folder is None else str((Path(folder) / value).resolve())


FilePath = Annotated[str, AfterValidator(_located)]
"""Path that is relative to the folder of the file it stands in."""


def problem(error: ValidationError, model: type[BaseModel] | None = None) -> str:
    """First thing wrong with a table, as one sentence that names the field.

    Parameters
    ----------
    error : what pydantic found.
    model : what was validated; with it an unknown field is answered with the nearest known one.

    Examples
    --------
    >>> class Line(Section):
    ...     count: int = Field(ge=2)
    >>> for wrong in ({"count": 1}, {"counts": 4, "count": 4}):
    ...     try:
    ...         Line.model_validate(wrong)
    ...     except ValidationError as error:
    ...         print(problem(error, Line))
    count is 1: input should be greater than or equal to 2.
    there is no field counts; did you mean count?
    """
    # An unknown field is likelier a slip than the cause of what else is missing.
    first = next((one for one in error.errors() if one["type"] == "extra_forbidden"), error.errors()[0])
    field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
    if first["type"] == "missing":
        return f"{field} is missing."
    if first["type"] == "extra_forbidden":
        return f"there is no field {field}{_nearest(model, first['loc'])}"
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        # Of a file of its own: a whole sentence, which names it.
        return f"{field}: {cause}"
    known = _KINDS.get(first["type"])
    message = first["msg"].removeprefix("Value error, ") if known is None else known.format(**first.get("ctx", {}))
    message = message[0].lower() + message[1:]
    # A table is too long to repeat; its own name says enough.
    value = "" if isinstance(first["input"], dict | list | tuple) else f" is {str(first['input'])[:60]!r}"
    if isinstance(first["input"], int | float):
        value = f" is {first['input']!r}"
    return f"{field}{value}: {message}." if field else f"{message}."


def _nearest(model: type[BaseModel] | None, place: tuple[int | str, ...]) -> str:
    """What follows the name of an unknown field: the nearest known one, or all of them."""
    for part in place[:-1]:
        if model is None or isinstance(part, int):
            continue
        field = model.model_fields.get(part)
        model = None if field is None else next(models_of(field.annotation), None)
    if model is None:
        return "."
    names = list(model.model_fields)
    near = difflib.get_close_matches(str(place[-1]), names, 1, cutoff=0.6)
    known = ", ".join([*names[:12], *(["..."] if len(names) > 12 else [])])
    return f"; did you mean {near[0]}?" if near else f"; known are {known}."


def models_of(annotation: Any) -> Iterator[type[BaseModel]]:
    """Sections within an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from models_of(part)


def require_sector(ends: tuple[float, float] | None) -> None:
    """Refuse a sector whose bearings are the same or beyond a turn; none is all around.

    Raises
    ------
    ValueError : for a validator.
    """
    if ends is not None and (max(map(abs, ends)) > 360 or (ends[1] - ends[0]) % 360 == 0):
        raise ValueError(
            f"sector_deg goes from {ends[0]:g} to {ends[1]:g} degrees: expected two different bearings, -360 to 360"
        )


def validated(model: type[Any], content: Any, source: object = None, folder: Path | None = None) -> Any:
    """Section of some content.

    Parameters
    ----------
    model : class of the section.
    content : a dictionary, or a section of that class.
    source : where the content comes from, for the message.
    folder : that its paths are relative to; left as they are where not given.

    Raises
    ------
    InputError : a field is unknown, missing, or has a wrong value.
    """
    try:
        return model.model_validate(content, context={"folder": folder})
    except ValidationError as error:
        where = "" if source is None else f"{source}: "
        raise InputError(f"{where}{problem(error, model)}") from error


def read_toml(path: str | Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises
    ------
    InputError : the file is missing or no TOML.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}).") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path} is not valid TOML ({error}).") from error


def to_toml(section: BaseModel) -> str:
    """TOML text of a section with every field that has a value."""
    return tomli_w.dumps(section.model_dump(exclude_none=True, mode="json"))
