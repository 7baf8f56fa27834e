"""Scenarios: what to run with data of one kind. Every kind has its own sections, and no other kind's.

`Scenario(kind="frames", cells={"levels": [2.0]})` makes the scenario of a kind, and so does a file. The kind need not
be named where a section tells it (`[sonar]`), and nothing of it need be told where data decide: `faintrack.track` then
makes the scenario of the kind that the data are.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faintrack.errors import InputError
from faintrack.scenario.section import Section, read_toml, to_toml, validated

Sections = Mapping[str, Any]


class Scenario(Section):
    """What to run; the fields are the sections of the kind.

    Attributes
    ----------
    kind : of the data, a name in `faintrack.kinds.KINDS`.

    Raises
    ------
    InputError : the kind is unknown or cannot be told, or a field is unknown, missing or has a wrong value.

    Examples
    --------
    >>> scenario = Scenario(kind="frames", frames={"frame_interval": 0.04})
    >>> scenario.frames.frame_interval, scenario.tracker.declare
    (0.04, 0.97)
    """

    kind: str

    if TYPE_CHECKING:

        def __init__(self, **sections: Any) -> None: ...

    def __new__(cls, /, **sections: Any) -> "Scenario":
        """Scenario of the kind that the sections are of."""
        return super().__new__(cls) if cls is not Scenario else scenario_of(sections)

    @classmethod
    def read(cls, path: str | Path) -> "Scenario":
        """Scenario of a TOML file, whose paths are relative to its folder.

        Raises
        ------
        InputError : the file is missing or no TOML, or as above.
        """
        return scenario_of(read_toml(path), path, Path(path).parent)

    def to_toml(self) -> str:
        """TOML text with every field that has a value; `read` gives the same scenario back."""
        return to_toml(self)

    def save(self, path: str | Path) -> None:
        """Write the text to a file."""
        Path(path).write_text(self.to_toml(), encoding="utf-8")

    def _repr_html_(self) -> str:
        """Its text, as a notebook shows it."""
        import html

        return (
            f"<details open><summary>Scenario: {self.kind}</summary><pre>{html.escape(self.to_toml())}</pre></details>"
        )


def scenario_of(sections: Sections, source: object = None, folder: Path | None = None) -> Scenario:
    """Scenario of the kind that the sections are of.

    Parameters
    ----------
    sections : by name; `kind` is one of them, or some of them are of one kind alone.
    source : where they come from, for messages.
    folder : that their paths are relative to.

    Raises
    ------
    InputError : as `Scenario`.
    """
    from faintrack.kinds import kind_named

    where = "" if source is None else f"{source}: "
    name = kind_of_sections(sections, source)
    if name is None:
        from faintrack.kinds import KINDS

        raise InputError(f"{where}kind is missing; expected one of {', '.join(KINDS)}.")
    return validated(kind_named(name, source).scenario, {**sections, "kind": name}, source, folder)


def kind_of_sections(sections: Sections, source: object = None) -> str | None:
    """Name of the kind that sections are of; None where they may be of several.

    Raises
    ------
    InputError : the sections are of two kinds.
    """
    from faintrack.kinds import kind_named, kinds

    if sections.get("kind") is not None:
        return str(sections["kind"])
    able = [kind.name for kind in kinds() if set(sections) <= set(kind.scenario.model_fields)]
    if not able:
        _refuse_mixture(sections, source)
    # Of several those whose needs are met.
    whole = [name for name in able if needed(kind_named(name).scenario) <= set(sections)]
    return next(iter(able if len(able) == 1 else whole if len(whole) == 1 else ()), None)


def needed(scenario: type[Scenario]) -> set[str]:
    """Sections without which there is no scenario of a class."""
    return {name for name, field in scenario.model_fields.items() if field.is_required()}


def _refuse_mixture(sections: Sections, source: object) -> None:
    """Name two sections that no kind has together, or one that none has."""
    from faintrack.kinds import kinds

    where = "" if source is None else f"{source}: "
    homes = {name: [kind.name for kind in kinds() if name in kind.scenario.model_fields] for name in sections}
    for name, home in homes.items():
        if not home:
            import difflib

            known = sorted({field for kind in kinds() for field in kind.scenario.model_fields})
            near = difflib.get_close_matches(name, known, 1, cutoff=0.6)
            raise InputError(f"{where}there is no section {name}" + (f"; did you mean {near[0]}?" if near else "."))
    first, second = next((a, b) for a in homes for b in homes if a != b and not set(homes[a]) & set(homes[b]))
    raise InputError(
        f"{where}[{first}] is of {' or '.join(homes[first])} and [{second}] of {' or '.join(homes[second])}; "
        "expected sections of one kind of data."
    )


def merged(sections: Sections, others: Sections) -> dict[str, Any]:
    """Sections, with fields of others in place of their own."""
    result = dict(sections)
    for name, value in others.items():
        mine = result.get(name)
        # An array is one thing: half of one and half of another would be none.
        if name != "array" and isinstance(value, Mapping) and isinstance(mine, Mapping):
            result[name] = {**mine, **value}
        elif value is not None:
            result[name] = value
    return result
