"""Sets of bearings: what a detector of one or several observers reports in a scan, the target's among false ones.

A likelihood sums over all that the bearings may mean (`faintrack.likelihoods.bearing_sets`), and a Bernoulli filter
with particles, newborn where the bearings of a scan agree, follows one target at a time in the plane.
"""

from pathlib import Path

from faintrack.data.bearings import Bearings
from faintrack.kinds.bearings.sections import BearingsScenario
from faintrack.kinds.kind import Kind
from faintrack.kinds.rooms import room


def _holds(paths: tuple[Path, ...]) -> bool:
    from faintrack.io.columns import column_names

    return len(paths) == 1 and {"bearing_deg", "observer_x_m"} <= column_names(paths[0])


def _read(paths: tuple[Path, ...], scenario: BearingsScenario | None) -> Bearings:
    from faintrack.errors import InputError
    from faintrack.io.bearings import read_bearings

    if len(paths) > 1:
        raise InputError(f"{len(paths)} files of bearings were given; expected one file.")
    return read_bearings(paths[0])


def _describe(bearings: Bearings) -> dict[str, str]:
    span, length = bearings.times[-1] - bearings.times[0], bearings.length
    apart = f", {span / (length - 1):.4g} s apart on average" if length > 1 else ""
    observers = ", ".join(map(str, bearings.observers))
    return {
        "holds": f"{length} scans{apart}",
        "observers": f"{len(bearings.observers)}, with the numbers {observers}" if len(bearings.observers) > 1 else "1",
        "bearings": f"{len(bearings.bearing)}, {len(bearings.bearing) / length:.3g} a scan",
        "span": f"{span:g} s",
    }


KIND = Kind(
    name="bearings",
    title="Sets of bearings",
    scenario=BearingsScenario,
    data=Bearings,
    holds=_holds,
    read=_read,
    write=room("faintrack.io.bearings", "write_bearings"),
    plan=room("faintrack.kinds.bearings.plan", "plan"),
    simulate=room("faintrack.kinds.bearings.simulate", "simulate"),
    targets=room("faintrack.kinds.bearings.simulate", "targets"),
    silence=room("faintrack.kinds.bearings.simulate", "silence"),
    describe=_describe,
    about=room("faintrack.kinds.bearings.report", "about"),
    draw=room("faintrack.kinds.bearings.pictures", "draw"),
    shown="Bearings, existence, position",
    needs=("--scenario FILE",),
    surrogate=lambda data, scenario, seed: room("faintrack.kinds.surrogates", "mixed")(data, seed),
    stretch=room("faintrack.kinds.stretches", "of_bearings"),
    gained=room("faintrack.kinds.promise", "gained_by_target"),
)
