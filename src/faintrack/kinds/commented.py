"""A scenario with every field, its default and what it means, for a person to begin with."""

import functools
import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import Any

import tomli_w
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from faintrack.kinds import kind_named
from faintrack.scenario.section import models_of

WIDTH = 100
"""Characters of a line of comment."""


def commented_scenario(name: str) -> str:
    """Text of a scenario of a kind; as it stands it runs, if the examples that it holds suit the data.

    Parameters
    ----------
    name : of the kind.

    Raises
    ------
    InputError : there is no such kind.

    Examples
    --------
    >>> print(commented_scenario("frames").splitlines()[2])
    kind = "frames"
    """
    kind = kind_named(name)
    model = kind.scenario
    lines = [f"# What to run with data of the kind {kind.name}: {kind.title.lower()}.", "", f'kind = "{kind.name}"']
    texts = texts_of(model)
    sections = {field: about for field, about in model.model_fields.items() if any(models_of(about.annotation))}
    # What is no section stands above the first one, to which it would belong below it.
    for field in [name for name in model.model_fields if name not in sections and name != "kind"]:
        lines += ["", *_comment(texts.get(field, "")), f"# {field} ="]
    for field, about in sections.items():
        lines += ["", *_section(field, about, texts)]
    return "\n".join(lines) + "\n"


def _section(name: str, field: FieldInfo, texts: dict[str, str]) -> Iterator[str]:
    """Lines of a section; commented out where it need not be there."""
    model = next(models_of(field.annotation))
    listed = "tuple" in str(field.annotation) or "list" in str(field.annotation)
    optional = not field.is_required() and field.default is None
    mark = "# " if optional else ""
    first = (inspect.getdoc(model) or "").split("\n")[0]
    yield from _comment(texts.get(name, first))
    yield f"{mark}[[{name}]]" if listed else f"{mark}[{name}]"
    yield from _fields(model, mark)


def _fields(model: type[BaseModel], mark: str) -> Iterator[str]:
    """Lines of the fields of a section: those with a value as they are, others commented out."""
    texts = texts_of(model)
    for name, field in model.model_fields.items():
        yield from _comment(texts.get(name, ""))
        if field.is_required() or field.examples:
            value = _plain((field.examples or ["..."])[0])
            yield f"{mark}{name} = {_inline(value)}"
            continue
        default = default_of(field)
        yield f"{mark}{name} = {default}" if default else f"# {name} ="


def default_of(field: FieldInfo) -> str:
    """Default of a field as TOML; empty where there is none that one line can tell."""
    value = None if field.is_required() else _plain(field.get_default(call_default_factory=True))
    return "" if value is None or value == [] or isinstance(value, dict) else _inline(value)


def _inline(value: Any) -> str:
    """A value in TOML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name} = {_inline(part)}" for name, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return tomli_w.dumps({"value": value}).removeprefix("value = ").strip()


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, WIDTH)]


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return value.model_dump(exclude_none=True, mode="json")
    return [_plain(part) for part in value] if isinstance(value, tuple | list) else value


@functools.cache
def texts_of(model: type[BaseModel]) -> dict[str, str]:
    """What the docstring of a section says of each field; where it is silent or points to another, what that says."""
    known = {f"{base.__module__}.{base.__name__}": base for base in model.__mro__[1:] if issubclass(base, BaseModel)}
    texts: dict[str, str] = {}
    for base in reversed(known.values()):
        texts |= _written(base)
    for name, text in _written(model).items():
        place, _, rest = text.removeprefix("see ").partition("; ")
        if text.startswith("see ") and place.rstrip(".") in known:
            theirs = _written(known[place.rstrip(".")]).get(name, text)
            text = f"{theirs.rstrip('.')}. {rest}" if rest else theirs
        texts[name] = text
    return {name: text for name, text in texts.items() if name in model.model_fields}


def _written(model: type[BaseModel]) -> dict[str, str]:
    """What stands in the docstring of a section of each field."""
    doc = inspect.getdoc(model) or ""
    _, _, attributes = doc.partition("Attributes\n----------\n")
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in attributes.split("\n"):
        entry = re.match(r"(\w+(?:, \w+)*) : (.*)", line)
        if entry:
            names = entry[1].split(", ")
            for name in names:
                texts[name] = entry[2]
        elif line.startswith("    ") and names:
            for name in names:
                texts[name] += " " + line.strip()
        elif line.strip():
            break
    return {name: text.replace("`", "") for name, text in texts.items()}
