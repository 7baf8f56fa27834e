"""Speed, measured beside peers and beside what the machine could do at best, all in one run.

Every row is a function of the machine's own rates and of sizes; a row whose peer is not installed (extra `bench`) says
so. Times are the least of many repeats, with what the first call takes to compile apart.
"""

from collections.abc import Callable, Iterable, Iterator

import jax

from faintrack.bench.active import (
    cw_scan_base,
    cw_scan_fine,
    cw_scan_moving,
    fm_scan_base,
    fm_scan_batch,
    fm_scan_fine,
    fm_scan_moving,
    fm_scan_two,
)
from faintrack.bench.archive import archive_segment
from faintrack.bench.beams import beam_power_acoular, beam_power_numpy
from faintrack.bench.bernoulli import bernoulli_step_batch, bernoulli_step_single
from faintrack.bench.grids import implicit_step_4d, separable_step_base, separable_step_fine
from faintrack.bench.machine import Machine, measure
from faintrack.bench.monte_carlo import scenario1_run_step
from faintrack.bench.pixels import pixel_frame
from faintrack.bench.recording import track_55ch_realtime, track_above_horizon, track_tones
from faintrack.bench.rows import Row
from faintrack.bench.several import several_region, several_sea_trial, several_synthetic
from faintrack.bench.sizes import Sizes
from faintrack.bench.startup import help_seconds, import_seconds, tenet_seconds
from faintrack.bench.studies import study_seconds
from faintrack.bench.targets import TARGET_ROWS
from faintrack.errors import InputError

__all__ = ["FOR_GPU", "ROWS", "Row", "Sizes", "chosen", "run"]

ROWS: dict[str, Callable[[Machine, Sizes], Row]] = {
    row.__name__: row
    for row in (
        track_55ch_realtime,
        track_above_horizon,
        track_tones,
        bernoulli_step_single,
        bernoulli_step_batch,
        beam_power_acoular,
        beam_power_numpy,
        scenario1_run_step,
        implicit_step_4d,
        separable_step_base,
        separable_step_fine,
        several_sea_trial,
        several_synthetic,
        several_region,
        fm_scan_base,
        fm_scan_fine,
        fm_scan_moving,
        fm_scan_batch,
        fm_scan_two,
        cw_scan_base,
        cw_scan_fine,
        cw_scan_moving,
        pixel_frame,
        *TARGET_ROWS,
        archive_segment,
        study_seconds,
        import_seconds,
        help_seconds,
        tenet_seconds,
    )
}

FOR_GPU = {"several_region"}
"""Rows for a GPU; where JAX sees none they take gigabytes and seconds, and run only if they are named."""


def chosen(names: Iterable[str] | None = None) -> list[str]:
    """Rows to measure: those that are named, or all that the machine is for.

    Raises
    ------
    InputError : there is no row of that name.
    """
    if names is None:
        return [name for name in ROWS if name not in FOR_GPU or jax.default_backend() == "gpu"]
    names = list(names)
    for name in names:
        if name not in ROWS:
            raise InputError(f"there is no row {name!r} in the benchmark; the rows are {', '.join(ROWS)}.")
    return names


def run(names: Iterable[str], sizes: Sizes | None = None) -> Iterator[Row]:
    """Measure, one row after the other.

    Parameters
    ----------
    names : of the rows, see `chosen`.
    sizes : of the problems; those of the targets where not given.
    """
    sizes = Sizes() if sizes is None else sizes
    machine = measure(seconds=sizes.repeat_seconds)
    for name in names:
        yield ROWS[name](machine, sizes)
