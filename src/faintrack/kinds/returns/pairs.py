"""Pairs of a source and a receiver: which of them a scenario has, and which of them the returns belong to."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool

from faintrack.data.ping_tables import LABELS
from faintrack.data.returns import Returns
from faintrack.errors import InputError
from faintrack.kinds.returns.sections import ReturnsScenario, SonarSection
from faintrack.results.result import Result


@dataclass(frozen=True)
class SonarPair:
    """A source and a receiver.

    Attributes
    ----------
    source, receiver : names; empty where there is one without a name.
    table : the sonar that they are.
    """

    source: str
    receiver: str
    table: SonarSection

    @property
    def name(self) -> str:
        """Of both, for messages and results."""
        return " to ".join(name for name in (self.source, self.receiver) if name)


@runtime_checkable
class HasPair(Protocol):
    """What is known of a pair."""

    @property
    def pair(self) -> SonarPair:
        """The pair."""


def pairs_of(scenario: ReturnsScenario) -> tuple[SonarPair, ...]:
    """All pairs of a scenario."""
    return tuple(SonarPair(*names, table) for names, table in scenario.pairs.items())


def pairs_of_result(result: Result) -> tuple[SonarPair, ...]:
    """Pairs that reported in what a result was made of."""
    pairs = pairs_of(result.scenario)
    if "pair" not in result.data.coords:
        return pairs[:1]
    by_name = {pair.name: pair for pair in pairs}
    return tuple(by_name[str(name)] for name in result.data.pair.values)


def heard(scenario: ReturnsScenario, returns: Returns) -> tuple[tuple[SonarPair, Returns], ...]:
    """Pairs that report, in the order of the scenario, each with its returns.

    Parameters
    ----------
    scenario : names sources and receivers.
    returns : of all pairs.

    Raises
    ------
    InputError : returns name a source or receiver that the scenario does not, or do not name one where there are
        several.
    """
    pairs = {(pair.source, pair.receiver): pair for pair in pairs_of(scenario)}
    for number, platform in enumerate(LABELS):
        listed = getattr(scenario, f"{platform}s")
        told = any(labels[number] for labels in returns.pairs)
        if told and listed is None:
            raise InputError(
                f"{returns.origin}: there is a column {platform}, and the scenario has no [[{platform}s]]; expected "
                "them, with a name each."
            )
        if not told and listed is not None and len(listed) > 1:
            raise InputError(
                f"{returns.origin}: there is no column {platform}; expected it, since the scenario has {len(listed)} "
                f"[[{platform}s]]."
            )
    if not returns.pairs:
        return ((next(iter(pairs.values())), returns),)
    found = {}
    for number, labels in enumerate(returns.pairs):
        names = tuple(
            _named(scenario, platform, label, returns.origin) for platform, label in zip(LABELS, labels, strict=True)
        )
        if names in found:
            raise InputError(
                f"{returns.origin}: {' and '.join(name for name in names if name)} is told by a name and by a number; "
                "expected one of them."
            )
        found[names] = returns.of_pair(number)
    return tuple((pair, found[names]) for names, pair in pairs.items() if names in found)


def reported_by(scenario: ReturnsScenario, returns: Returns, parts: Sequence[HasPair]) -> Bool[np.ndarray, "ping pair"]:
    """Whether each of some pairs reported in a ping.

    Parameters
    ----------
    scenario, returns : as of `heard`.
    parts : what is known of the pairs that report, in their order.
    """
    if returns.reported is None:
        return np.ones((returns.length, 1), bool)
    names = [
        tuple(_named(scenario, platform, label, returns.origin) for platform, label in zip(LABELS, labels, strict=True))
        for labels in returns.pairs
    ]
    return returns.reported[:, [names.index((part.pair.source, part.pair.receiver)) for part in parts]]


def _named(scenario: ReturnsScenario, platform: str, label: str, origin: str) -> str:
    """Name in the scenario of a platform that returns tell by its name, or by its number from 1 on."""
    listed = [each.name for each in getattr(scenario, f"{platform}s") or ()]
    if label in listed:
        return label
    if not label:
        return listed[0] if listed else ""
    if label.isdecimal() and 1 <= int(label) <= len(listed):
        return listed[int(label) - 1]
    raise InputError(
        f"{origin}: {platform} is {label!r}; expected one of the [[{platform}s]] of the scenario, {', '.join(listed)}, "
        "or its number from 1 on."
    )
