"""The seam: what filters, trackers and simulations ask of a likelihood, and nothing else.

Every sensor enters through one question, `Likelihood.log_ratio`: how much likelier is this scan with a target at each
state than without one? Three more may be asked of those that can answer.

- `CellMeans.log_mean_ratio`: a grid's cell may be larger than the structure of the ratio in it. What it needs then is
  the mean ratio over its states, which a likelihood of cells knows for a grid of its own, whatever is believed.
- `Proposing.propose`: newborn particles where the scan points, with weights that make up for it. A likelihood without
  it has them drawn from the birth density.
- `Simulating.simulate`: a scan drawn from the very model that the ratio evaluates.
- `Beside.beside`: the scan as it is with other targets as part of its background. What is asked of it then is the ratio
  for one target more. What each of them puts there, `part`, is worked out once and taken in with the existence that
  the question is about. `alike` says which states a scan hardly tells apart.
- `Zooming.zoomed`: what a scan says near a belief that is far narrower than all that may be asked.
- `Preparing.prepared`: the scan with what several of these questions need worked out.
- `Sighted.in_sight`: which states can be seen at all, by a target that is silent too.
"""

from typing import Any, Protocol, TypeVar, runtime_checkable

import jax
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.targets.target import Birth

Scan = TypeVar("Scan")
State = TypeVar("State")
Part = TypeVar("Part")
ScanRead = TypeVar("ScanRead", contravariant=True)
StateRead = TypeVar("StateRead", contravariant=True)


@runtime_checkable
class Likelihood(Protocol[ScanRead, StateRead]):
    """Says how much likelier a scan is with a target at each state than without one."""

    def log_ratio(self, scan: ScanRead, states: StateRead) -> Float[Array, "..."]:
        """Natural log of p(scan | target at state) / p(scan | no target), in the shape that the states broadcast to."""


@runtime_checkable
class CellMeans(Protocol[ScanRead]):
    """Says how much likelier a scan is with a target in each cell of a grid than without one."""

    def log_mean_ratio(self, scan: ScanRead) -> Float[Array, "..."]:
        """Natural log of the mean over each cell of p(scan | target at state) / p(scan | no target)."""


@runtime_checkable
class Proposing(Protocol[ScanRead, State]):
    """Draws new targets where a scan points."""

    def propose(
        self, scan: ScanRead, birth: Birth[State], key: PRNGKeyArray, count: int
    ) -> tuple[State, Float[Array, " count"]]:
        """Draw `count` states, and the natural log of their weights: birth density over density of the draws."""


@runtime_checkable
class Beside(Protocol[Scan, StateRead, Part]):
    """Looks at scans of several targets."""

    def part(self, scan: Scan, states: StateRead, log_weights: Float[Array, "*points"]) -> Part:
        """What a target puts into the background of a scan, if it is there.

        Parameters
        ----------
        scan : without it.
        states, log_weights : what is believed of it.
        """

    def beside(self, scan: Scan, parts: Part, existence: Float[Array, " target"]) -> Scan:
        """Scan with other targets as part of its background.

        Parameters
        ----------
        scan : with or without targets in its background already.
        parts : of the others, stacked.
        existence : probability that each is there; one with 0 adds nothing.
        """

    def alike(self, scan: Scan, states: StateRead, centres: StateRead) -> Bool[Array, "centre *points"]:
        """Whether a target at a state and one at a centre are one to the sensor.

        Parameters
        ----------
        scan : where the sensor is.
        states : any; broadcast to the shape of the points.
        centres : components have the shape (centre,).
        """


@runtime_checkable
class Reading(Protocol[StateRead]):
    """What one scan says."""

    def log_ratio(self, states: StateRead) -> Float[Array, "..."]:
        """Natural log of p(scan | target at state) / p(scan | no target)."""


@runtime_checkable
class Zooming(Protocol[ScanRead, StateRead]):
    """Looks closely at scans."""

    def zoomed(self, scan: ScanRead, states: StateRead, log_weights: Float[Array, " point"]) -> Reading[StateRead]:
        """What a scan says near a belief."""


@runtime_checkable
class Preparing(Protocol[Scan]):
    """Works out once what several questions about a scan need."""

    def prepared(self, scan: Scan) -> Scan:
        """Scan that answers as before, and faster."""


@runtime_checkable
class Sighted(Protocol[StateRead]):
    """Sees some states only."""

    def in_sight(self, states: StateRead) -> Float[Array, "..."]:
        """Natural log of what sight says of a state without any scan; 0 in sight."""


@runtime_checkable
class Simulating(Protocol[Scan, StateRead]):
    """Draws scans."""

    def simulate(self, scan: Scan, states: StateRead, present: Bool[Array, ""], key: PRNGKeyArray) -> Scan:
        """Draw what is measured from the model that the ratio evaluates.

        Parameters
        ----------
        scan : all but what is measured is kept: time, geometry, masks, number of entries.
        states : of one target; components are scalars.
        present : whether it is there; otherwise noise alone is drawn.
        key : random key.
        """


def with_others(
    likelihood: Any,
    scan: Any,
    states: Any,
    log_weights: Float[Array, "target *points"],
    existence: Float[Array, " target"],
) -> Any:
    """Scan with targets as part of its background.

    Parameters
    ----------
    likelihood : of the scan; it has `part` and `beside`.
    scan : with or without targets in its background already.
    states, log_weights : what is believed of the targets, a belief each.
    existence : probability that each is there.
    """
    part = jax.vmap(lambda states, log_weights: likelihood.part(scan, states, log_weights))
    return likelihood.beside(scan, part(states, log_weights), existence)


def log_ratios(likelihood: Likelihood | CellMeans, scan: Any, states: Any) -> Float[Array, "..."]:
    """Log ratio of every point of a belief: at its state, or over the cell whose middle it is."""
    if isinstance(likelihood, CellMeans):
        return likelihood.log_mean_ratio(scan)
    return likelihood.log_ratio(scan, states)
