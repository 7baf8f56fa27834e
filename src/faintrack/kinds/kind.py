"""What is known of a kind of data, as one value, and how such data are taken in.

A kind is what a file can hold: samples of an array, frames, returns of a sonar. Everything that is particular to it
stands in its folder and is gathered in one `Kind`; the loop (`faintrack.kinds.loop`), the verbs
(`faintrack.kinds.door`), command line, report and calibration know that value and no kind by name.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import xarray as xr
from jaxtyping import PRNGKeyArray

from faintrack.kinds.scenario import Scenario
from faintrack.results.truth import Known
from faintrack.scenario.plane import Plane


@runtime_checkable
class Step(Protocol):
    """What is compiled: scans of a block, taken in one after the other. An `equinox.Module`."""

    def scans(self, block: Any) -> Any:
        """Scans of a block, stacked along the first axis of every field; computed for the whole block at once."""

    def advance(self, state: Any, scan: Any, key: PRNGKeyArray) -> tuple[Any, Any]:
        """State after a scan, and what is to be known of it. `key` is that of the whole run."""


@dataclass(frozen=True)
class Plan:
    """How some data become a result.

    Attributes
    ----------
    scenario : what is run, with what was chosen for these data filled in.
    step : what is compiled.
    state : before the first scan.
    read : function of (start, stop), numbers of scans, to arrays with one entry a scan along their first axis, as
        `step.scans` takes them. Fewer than asked for is the end.
    rows : function of (start, block, outputs), the number of the first scan, what was read and what `step.advance`
        gave, to a dataset in the schema of `faintrack.results.schema`.
    length : number of scans; None where it is not known beforehand.
    size : scans taken in at once.
    seed : of the random numbers.
    plane : plane of places given in latitude and longitude, a `faintrack.scenario.plane.Plane`; None where there
        is none.
    within : how near a track must be to a known target to be one of it, in the unit of the place.
    limits : ends of each component of the place between which known targets count; everywhere where None.
    checks : what the set-up cannot tell or does not fit, known before the run; one sentence each.
    remarks : gives, at the end, what was left out or assumed; one sentence each.
    misfits : gives, at the end, where the data are not as the model has them, so that existence is not certain; one
        sentence each.
    check : looks closely at the sensor without a run; one sentence each. None where there is nothing to look at.
    close : function of the last state to what is known at the end, without a time axis; None where there is nothing.
    """

    scenario: Scenario
    step: Step
    state: Any
    read: Callable[[int, int], Any]
    rows: Callable[[int, Any, Any], xr.Dataset]
    length: int | None
    size: int
    seed: int
    plane: Plane | None = None
    within: float = math.inf
    limits: dict[str, tuple[float, float]] | None = None
    checks: tuple[str, ...] = ()
    remarks: Callable[[], tuple[str, ...]] = tuple
    misfits: Callable[[], tuple[str, ...]] = tuple
    check: Callable[[], tuple[str, ...]] | None = None
    close: Callable[[Any], xr.Dataset] | None = None


@dataclass(frozen=True)
class Kind:
    """A kind of data.

    Attributes
    ----------
    name : one word, as in a scenario.
    title : what it is in a few words.
    scenario : class of its scenarios.
    data : class of its data in memory.
    holds : whether files can be nothing else; function of paths.
    takes : whether files that hold another kind can be read too, where the sections of a scenario are of this one.
    read : function of paths and a scenario, or None where there is none, to data.
    write : function of a path and data, that writes what `read` reads.
    plan : function of data and scenario to a `Plan`.
    simulate : function of a scenario to data that its `[simulation]` describes.
    targets : function of a scenario to the targets of its simulation, a list of `faintrack.results.truth.Known`.
    silence : function of a scenario and a seed to such data without a target.
    describe : facts of data as `faintrack info` tells them, by name.
    about : facts of a result as its report tells them, by name.
    draw : function of a result to a figure of matplotlib.
    shown : what the figure shows.
    calibrate : a faster way to a threshold than counting runs on silence, called as `faintrack.kinds.calibration` does.
    needs : what the command line needs beside the files, where there is no scenario.
    surrogate : function of data, scenario and a seed to data without the targets that they hold, made of them; see
        `faintrack.kinds.surrogates`. None where there is no way.
    stretch : function of data and two times, seconds from the first scan, to the data between; see
        `faintrack.kinds.stretches`. None where there is no way.
    gained : function of a scenario to what its odds of existence gain in a second at most without evidence
        (`faintrack.metrics.false_tracks`); None where what it tracks by is no likelihood ratio of one target.
    """

    name: str
    title: str
    scenario: type[Scenario]
    data: type
    holds: Callable[[tuple[Path, ...]], bool]
    read: Callable[[tuple[Path, ...], Any], Any]
    write: Callable[[Path, Any], None]
    plan: Callable[[Any, Any], Plan]
    simulate: Callable[[Any], Any]
    targets: Callable[[Any], list[Known]]
    silence: Callable[[Any, int], Any]
    describe: Callable[[Any], dict[str, str]]
    about: Callable[[Any], dict[str, str]]
    draw: Callable[[Any], Any]
    shown: str
    calibrate: Callable[..., Any] | None = None
    needs: tuple[str, ...] = ()
    takes: Callable[[tuple[Path, ...]], bool] = lambda paths: False
    surrogate: Callable[[Any, Any, int], Any] | None = None
    stretch: Callable[[Any, float, float], Any] | None = None
    gained: Callable[[Any], float | None] = lambda scenario: None
