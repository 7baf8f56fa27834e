"""A kind of one's own, made of public names: counts of a row of cells, in one of which a source may be."""

import dataclasses
import functools
from pathlib import Path
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float
from matplotlib.figure import Figure
from pydantic import Field

from faintrack import InputError, Result, Scenario
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.kinds.kind import Kind, Plan
from faintrack.kinds.loop import begun
from faintrack.results.pictures import draw_component, draw_existence
from faintrack.results.schema import Component, estimated
from faintrack.results.truth import Known
from faintrack.scenario.section import Section
from faintrack.scenario.sections import ParticlesSection, TargetSection, TrackerSection
from faintrack.targets.target import Target, UniformBirth
from faintrack.trackers.single import SingleTargetTracker

COMPONENTS = (Component("cell", "cell", place=True),)
STEP = 0.3
"""Cells that a source wanders in a second."""


@dataclasses.dataclass(frozen=True)
class Counts:
    """Counts of (scan, cell), a second apart."""

    values: np.ndarray
    source: str = "counts in memory"


@functools.partial(jax.tree_util.register_dataclass, data_fields=["cell"], meta_fields=[])
@dataclasses.dataclass(frozen=True)
class Spot:
    """Where a source is."""

    cell: Any


class Wander(eqx.Module):
    """A random walk."""

    def move(self, states: Spot, interval: Any, key: Any) -> Spot:
        return Spot(states.cell + STEP * jnp.sqrt(interval) * jax.random.normal(key, states.cell.shape))


class Scan(eqx.Module):
    """Counts of the cells at a time."""

    time: Array
    counts: Float[Array, "*scan cell"]


class PoissonLikelihood(eqx.Module):
    """Poisson counts of mean `background`, and `source` on top in the cell of the source."""

    background: float
    source: float

    def log_ratio(self, scan: Scan, states: Spot) -> Array:
        cell = jnp.clip(jnp.round(states.cell).astype(int), 0, scan.counts.shape[0] - 1)
        return scan.counts[cell] * jnp.log1p(self.source / self.background) - self.source


class CountsStep(eqx.Module):
    """Counts through the tracker."""

    tracker: SingleTargetTracker

    def scans(self, block: Scan) -> Scan:
        return block

    def advance(self, state: Any, scan: Scan, key: Any) -> tuple[Any, Any]:
        return self.tracker.step(state, scan, key)


class CountsSection(Section):
    """What is counted.

    Attributes
    ----------
    background : mean count of a cell without a source.
    source : mean count that a source adds.
    """

    background: float = Field(gt=0, examples=[2.0])
    source: float = Field(gt=0, examples=[8.0])


class SimulationSection(Section):
    """Counts to draw.

    Attributes
    ----------
    scans, cells : how many.
    cell : of the source.
    seed : of the random numbers.
    """

    scans: int = Field(gt=0, examples=[20])
    cells: int = Field(gt=1, examples=[16])
    cell: int | None = None
    seed: int = 0


class ToyScenario(Scenario):
    """What to run with counts."""

    kind: Literal["toy"] = "toy"
    counts: CountsSection
    target: TargetSection = TargetSection()
    filter: ParticlesSection = ParticlesSection()
    tracker: TrackerSection = TrackerSection()
    simulation: SimulationSection | None = None


def plan(counts: Counts, scenario: ToyScenario) -> Plan:
    values = np.asarray(counts.values, np.float32)
    if values.min() < 0:
        raise InputError(f"{counts.source}: a count is below 0; expected counts.")
    ends = (Spot(jnp.asarray(end, jnp.float32)) for end in (-0.5, values.shape[1] - 0.5))
    target = Target(UniformBirth(*ends), Wander(), scenario.target.arrival_rate, scenario.target.departure_rate)
    tracker = SingleTargetTracker(
        BernoulliParticleFilter(target, scenario.filter.particles, scenario.filter.births),
        PoissonLikelihood(scenario.counts.background, scenario.counts.source),
        scenario.tracker.declare,
        scenario.tracker.drop,
    )
    times = np.arange(len(values), dtype=float)

    def rows(start: int, block: Scan, estimates: Any) -> xr.Dataset:
        facts = {"kind": "toy", "source": counts.source, "start_time": "", "first_scan_time": 0.0, "scan_interval": 1.0}
        return estimated(block.time, estimates, COMPONENTS).assign_attrs(facts)

    return Plan(
        scenario=scenario,
        step=CountsStep(tracker),
        state=begun(tracker, scenario.filter.seed),
        read=lambda start, stop: Scan(times[start:stop], values[start:stop]),
        rows=rows,
        length=len(values),
        size=8,
        seed=scenario.filter.seed,
        within=1.5,
    )


def read(paths: tuple[Path, ...], scenario: ToyScenario | None) -> Counts:
    (path,) = paths
    return Counts(np.loadtxt(path, ndmin=2), str(path))


def write(path: Path, counts: Counts) -> None:
    np.savetxt(path, counts.values, "%d")


def drawn(scenario: ToyScenario, cell: int | None, seed: int) -> Counts:
    section = scenario.simulation
    if section is None:
        raise InputError("the scenario has no [simulation]; expected one with scans and cells.")
    mean = np.full((section.scans, section.cells), scenario.counts.background)
    if cell is not None:
        mean[:, cell] += scenario.counts.source
    return Counts(np.random.default_rng(seed).poisson(mean), "simulation")


def simulate(scenario: ToyScenario) -> Counts:
    section = scenario.simulation
    return drawn(scenario, None if section is None else section.cell, 0 if section is None else section.seed)


def targets(scenario: ToyScenario) -> list[Known]:
    cell = None if scenario.simulation is None else scenario.simulation.cell
    return [] if cell is None else [Known("source", lambda times: {"cell": np.full(len(times), float(cell))})]


def describe(counts: Counts) -> dict[str, str]:
    return {"holds": "{} counts of {} cells".format(*counts.values.shape)}


def about(result: Result) -> dict[str, str]:
    return {"counts": str(result.data.attrs["source"])}


def draw(result: Result) -> Figure:
    figure = Figure(layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    draw_existence(above, result)
    draw_component(below, result.data, "cell")
    return figure


KIND = Kind(
    name="toy",
    title="Counts of a row of cells",
    scenario=ToyScenario,
    data=Counts,
    holds=lambda paths: False,
    read=read,
    write=write,
    plan=plan,
    simulate=simulate,
    targets=targets,
    silence=lambda scenario, seed: drawn(scenario, None, seed),
    describe=describe,
    about=about,
    draw=draw,
    shown="Existence, cell",
)
