"""What every watch has, whatever brings its data: samples that stream, files that grow, lines that come.

The call that watches (`faintrack.live.run`), the folder and the page know this and no kind of data.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.kinds.door import Moment
from faintrack.kinds.kind import Kind, Plan
from faintrack.kinds.loop import Checkpoint

Tell = Callable[[Mapping[str, Any]], None]
"""Is called with each event: a dictionary of plain values whose `event` is its name."""


@dataclass
class Status:
    """How a watch stands.

    Attributes
    ----------
    scans : taken in by this process.
    behind_s : seconds of data that have come and were not taken in yet.
    gaps : stretches of missing data.
    missing_s : their length; seconds.
    left_out : scans that were passed over because the machine was too slow.
    """

    scans: int = 0
    behind_s: float = 0.0
    gaps: int = 0
    missing_s: float = 0.0
    left_out: int = 0


class Watching(Protocol):
    """Data on their way through the loop."""

    @property
    def kind(self) -> Kind:
        """Of the data."""

    @property
    def source(self) -> str:
        """Where the data come from, for messages."""

    @property
    def plan(self) -> Plan:
        """Of the data so far."""

    @property
    def checkpoint(self) -> Checkpoint | None:
        """Where a later run goes on; None where it begins anew."""

    @property
    def status(self) -> Status:
        """How it stands."""

    @property
    def counts(self) -> Mapping[str, int]:
        """What went wrong on the way, by name."""

    @property
    def opening(self) -> Float[np.ndarray, "sample channel"] | None:
        """Samples that the plan was made from, where another run could not read them again."""

    def moments(self) -> Iterator[Moment]:
        """Yield what is known after every scan, until the data end or the watch is stopped."""

    def start(self) -> dict[str, Any]:
        """Event with which the watch begins."""

    def facts(self) -> dict[str, Any]:
        """Plain values that a later run needs beside the checkpoint."""

    def remarks(self) -> tuple[str, ...]:
        """What a reader of the result must know, one sentence each."""

    def misfits(self) -> tuple[str, ...]:
        """Where the data are not as the model has them, one sentence each."""

    def close(self, state: Any) -> xr.Dataset | None:
        """What is known after a scan beside the scans themselves, as `Plan.close`; its state is given."""
