"""The seam: what filters, trackers and simulations ask of a likelihood, and nothing else.

Every sensor enters through one question, `Likelihood.log_ratio`: how much likelier is this scan with a target at each
state than without one? Three more may be asked of those that can answer.

- `CellMeans.log_mean_ratio`: a grid's cell may be larger than the structure of the ratio in it. What it needs then is
  the mean ratio over its states, which a likelihood of cells knows for a grid of its own, whatever is believed.
- `Proposing.propose`: newborn particles where the scan points, with weights that make up for it. A likelihood without
  it has them drawn from the birth density.
- `Simulating.simulate`: a scan drawn from the very model that the ratio evaluates.
"""

from typing import Any, Protocol, TypeVar, runtime_checkable

from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.targets.target import Birth

Scan = TypeVar("Scan")
State = TypeVar("State")
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


def log_ratios(likelihood: Likelihood | CellMeans, scan: Any, states: Any) -> Float[Array, "..."]:
    """Log ratio of every point of a belief: at its state, or over the cell whose middle it is."""
    if isinstance(likelihood, CellMeans):
        return likelihood.log_mean_ratio(scan)
    return likelihood.log_ratio(scan, states)
