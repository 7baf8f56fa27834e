"""Tables of a scenario for the returns of an active sonar: its bins and responses, and the grid that is searched."""

import math
from typing import Annotated

from pydantic import Field, model_validator

from faintrack.scenario.array import Pair, Table


class PulseTable(Table):
    """What an active sonar transmits; see `faintrack.sensors.active.Pulse`.

    Attributes
    ----------
    frequency : in its middle; Hz.
    duration : s.
    bandwidth : of a linear sweep; Hz; 0 for a pulse of constant frequency.
    factor : of the sinc's argument: pi for the matched filter of an ideal pulse, 1 as aughenbaugh2010 has it.
    """

    frequency: float = Field(gt=0)
    duration: float = Field(gt=0)
    bandwidth: float = Field(default=0.0, ge=0)
    factor: float = Field(default=math.pi, gt=0)


Bins = Annotated[int, Field(ge=1, le=1_000_000)]
Reach = Annotated[
    tuple[
        Annotated[int, Field(ge=0, le=12)],
        Annotated[int, Field(ge=0, le=12)],
        Annotated[int, Field(ge=0, le=12)],
    ],
    Field(strict=False),
]
Finer = Annotated[
    tuple[
        Annotated[int, Field(ge=1, le=8)],
        Annotated[int, Field(ge=1, le=8)],
        Annotated[int, Field(ge=1, le=8)],
    ],
    Field(strict=False),
]
"""Bins or points along delay, bearing and Doppler; their tables grow with the product of all."""


class SonarTable(Table):
    """An active sonar whose returns are tracked; see `faintrack.sensors.active` and `faintrack.likelihoods.guided`.

    Attributes
    ----------
    pulse : what is transmitted.
    delay : middles of the first and the last bin; s. What is blanked after the pulse lies before the first.
    delay_bins, delay_step : number of the bins, or from one to the next in s; exactly one of them.
    beams : evenly around the receiver, the first to the east.
    beam_width_deg : first zeros of a beam lie pi times this from its middle.
    doppler : middles of the first and the last bin; Hz. Where not given, Doppler is not measured.
    doppler_bins, doppler_step : as those of the delay.
    source, receiver : where they stand still: metres east and north. The columns of the returns take their place.
    sound_speed : m/s.
    threshold_db : that returns exceed, over the mean power of the noise.
    snr_db : mean power of a target's echo in its bin, over that of the noise.
    reach : bins of delay, bearing and Doppler from its place in which an echo is heard; in bearing all around at most.
    swath : bins from a return in which the likelihood is sampled; likewise.
    finer : samples a bin.
    """

    pulse: PulseTable
    delay: Pair
    delay_bins: Bins | None = None
    delay_step: float | None = Field(default=None, gt=0)
    beams: int = Field(ge=3, le=7200)
    beam_width_deg: float = Field(gt=0, le=180)
    doppler: Pair | None = None
    doppler_bins: Bins | None = None
    doppler_step: float | None = Field(default=None, gt=0)
    source: Pair | None = None
    receiver: Pair | None = None
    sound_speed: float = Field(default=1500.0, gt=0)
    threshold_db: float = Field(gt=0, le=60)
    snr_db: float = Field(ge=-40, le=80)
    reach: Reach = (10, 6, 6)
    swath: Reach = (5, 3, 3)
    finer: Finer = (1, 4, 1)

    @model_validator(mode="after")
    def _bins_fit(self) -> "SonarTable":
        if self.delay[0] < 0:
            raise ValueError(f"delay begins at {self.delay[0]:g} s: expected at least 0")
        _require_bins("delay", self.delay, self.delay_bins, self.delay_step)
        _require_bins("doppler", self.doppler, self.doppler_bins, self.doppler_step)
        return self


def _require_bins(name: str, ends: Pair | None, bins: int | None, step: float | None) -> None:
    """Refuse bins whose number does not follow from what is given."""
    if ends is None:
        if bins is not None or step is not None:
            raise ValueError(f"there are bins of {name}: expected {name} with the first and the last")
        return
    if (bins is None) == (step is None):
        raise ValueError(f"expected exactly one of {name}_bins and {name}_step")
    first, last = ends
    if not first < last:
        raise ValueError(f"{name}: expected the first bin below the last")
    if bins == 1:
        raise ValueError(f"{name}_bins is 1: expected at least 2")
    if step is not None:
        steps = (last - first) / step
        if abs(steps - round(steps)) > 0.01 or not 1 <= round(steps) < 1_000_000:
            raise ValueError(f"{name}_step is {step:g}: expected to fit a whole number of times, not {steps:.6g}")


class GridTable(Table):
    """Cells over which a target is looked for.

    Attributes
    ----------
    x, y : where the grid begins and ends, east and north; m.
    cells : number along x and y.
    speed : targets move at most this fast along each axis, either way; m/s.
    speeds : number of cells along each axis of the velocity, from -`speed` to `speed`.
    """

    x: Pair
    y: Pair
    cells: Annotated[
        tuple[Annotated[int, Field(ge=2, le=10_000)], Annotated[int, Field(ge=2, le=10_000)]], Field(strict=False)
    ]
    speed: float = Field(gt=0)
    speeds: int = Field(default=7, ge=1, le=99)

    @model_validator(mode="after")
    def _ordered(self) -> "GridTable":
        for name, (low, high) in (("x", self.x), ("y", self.y)):
            if not low < high:
                raise ValueError(f"{name} goes from {low:g} to {high:g} m: expected the lower end first")
        return self
