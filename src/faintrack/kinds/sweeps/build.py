"""From the sections of a scenario to what tracks in sweeps."""

import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.errors import InputError
from faintrack.kinds.sweeps.data import Sweeps
from faintrack.kinds.sweeps.echoes import Echoes
from faintrack.kinds.sweeps.sections import SweepsScenario
from faintrack.kinds.sweeps.tracker import SweepsTracker
from faintrack.kinds.sweeps.windows import TOGETHER, Layout
from faintrack.targets.target import Target

BEAM = 2.0
"""Rows to a standard deviation of an echo, about: spokes are averaged to that."""

NEAREST = 8
"""Lengths of an echo within which nothing is looked for by default."""

LARGEST = 2 * 10**9
"""Points of all windows at most; each takes four bytes, twice."""


def chosen(scenario: SweepsScenario, sweeps: Sweeps) -> SweepsScenario:
    """Scenario with what was chosen for some sweeps filled in.

    Raises
    ------
    InputError : the first sweep holds no echo, so that the full scale must be told.
    """
    section = scenario.sweeps.model_copy(update={"sample_spacing": sweeps.spacing})
    if section.nearest is None:
        section = section.model_copy(update={"nearest": NEAREST * scenario.echo.along * sweeps.spacing})
    echo = scenario.echo
    if echo.full_scale is None:
        largest = float(np.max(sweeps.read(0, 1)))
        if not largest > 0:
            raise InputError(f"{sweeps.source}: the first sweep holds no echo; expected echo.full_scale.")
        echo = echo.model_copy(update={"full_scale": largest})
    return scenario.model_copy(update={"sweeps": section, "echo": echo})


def averaged_spokes(scenario: SweepsScenario, spokes: int) -> int:
    """Spokes to a row: as many as divide their number and leave an echo `BEAM` rows wide.

    Examples
    --------
    >>> averaged_spokes(SweepsScenario(), 2048), averaged_spokes(SweepsScenario(), 2049)
    (4, 3)
    """
    most = max(1, int(scenario.echo.across / BEAM))
    return next(count for count in range(most, 0, -1) if spokes % count == 0)


def build_tracker(scenario: SweepsScenario, sweeps: Sweeps) -> SweepsTracker:
    """Tracker of a scenario, with what was chosen filled in, for some sweeps.

    Raises
    ------
    InputError : the windows do not fit into a sweep, or into memory.
    """
    (spokes, samples), echo, table = sweeps.shape, scenario.echo, scenario.filter
    average = averaged_spokes(scenario, spokes)
    echoes = Echoes(
        rows=spokes // average,
        samples=samples,
        offset=(average - 1) / 2 / average,
        spacing=sweeps.spacing,
        across=echo.across / average,
        along=echo.along,
        levels=tuple(level / echo.deviation for level in echo.levels),
    )
    target = Target(None, None, scenario.target.arrival_rate, scenario.target.departure_rate)
    if table.speeds % 2 == 0:
        raise InputError(f"filter.speeds is {table.speeds}; expected an odd number, so that one of them is rest.")
    speed = scenario.target.speed
    speeds = Axis(-speed, 2 * speed / (table.speeds - 1), table.speeds)
    layout = Layout(
        echoes, target, scenario.target.moving, speeds, scenario.target.velocity_noise, scenario.tracker.drop
    )
    if 2 * layout.shape[0] > echoes.rows or 2 * layout.shape[1] > samples:
        raise InputError(
            f"an echo of {echo.across:g} spokes by {echo.along:g} samples makes windows of "
            f"{layout.shape[0] * average} by {layout.shape[1]}; "
            f"expected at most half of the {spokes} spokes and {samples} samples of a sweep."
        )
    capacity = -(-table.windows // TOGETHER) * TOGETHER
    if capacity * layout.points > LARGEST:
        raise InputError(
            f"{capacity} windows of {layout.points} points are more than {LARGEST:,} points; expected fewer "
            "filter.windows or filter.speeds."
        )
    nearest = round((scenario.sweeps.nearest or 0.0) / sweeps.spacing)
    tracker = scenario.tracker
    return SweepsTracker(
        layout, capacity, tracker.slots, tracker.declare, tracker.drop, tracker.hold, table.watch, nearest
    )
