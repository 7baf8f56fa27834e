"""A scenario with every field, its default and what it means, for a person to begin with."""

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
    texts = _texts(model)
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
    texts = _texts(model)
    for name, field in model.model_fields.items():
        yield from _comment(texts.get(name, ""))
        if field.is_required() or field.examples:
            value = _plain((field.examples or ["..."])[0])
            yield f"{mark}{name} = {_inline(value)}"
            continue
        value = _plain(field.get_default(call_default_factory=True))
        if value is None or value == [] or isinstance(value, dict):
            yield f"# {name} ="
        else:
            yield f"{mark}{name} = {_inline(value)}"


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


def _texts(model: type[BaseModel]) -> dict[str, str]:
    """What the docstring of a section says of each field."""
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
