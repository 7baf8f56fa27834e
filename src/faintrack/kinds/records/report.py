"""Facts of a result of records, as its report tells them."""

import numpy as np

from faintrack.results.result import Result


def about(result: Result) -> dict[str, str]:
    """Facts by name."""
    data, region, target = result.data, result.scenario.region, result.scenario.target
    fastest = f"{target.bearing_rate_deg:g} degrees a second" if region is None else f"{region.speed:g} m/s"
    wide = "" if region is None else f", {region.cell:g} m wide"
    silent = data.record.isnull().all("beam").sum("time").values
    levels = result.scenario.energies.levels
    cells = " x ".join(str(count) for count in np.atleast_1d(data.attrs["cells"]))
    several = result.scenario.several
    undecided = int(data.undecided.any("slot").sum())
    return {
        "records": str(data.attrs["source"]),
        "start": data.attrs["start_time"] or "not known",
        "scans": f"{data.sizes['time']}, {data.attrs['scan_interval']:.6g} s apart",
        "first scan": f"{data.attrs['first_scan_time']:.10g} s on the clock of the records; times are from there",
        "arrays": "; ".join(
            f"{name}, {'a line' if line else 'all around'}, {int(np.isfinite(beams).sum())} beams"
            + (f", {missing} scans without a row" if missing else "")
            for name, line, beams, missing in zip(
                data.array.values, data.line.values, data.beam_bearing.values, silent, strict=True
            )
        ),
        "energies": "mean {:g} and standard deviation {:g} without a target, {:g} and {:g} with one".format(
            *levels[0], *levels[1]
        )
        + (", in standard deviations above each scan's median" if result.scenario.energies.absent is None else ""),
        "elsewhere": f"a beam holds a source that is no target with probability {result.scenario.energies.elsewhere:g}",
        "detectors": f"{data.sizes['detector']} of {cells} cells{wide}, up to {fastest}",
        "slots": f"{data.sizes['slot']}",
        "declared": f"at existence {several.declare:g}, {several.hold} scans in hand",
        "undecided": "nothing"
        if not undecided
        else f"in {undecided} scans, targets that could be neither declared nor given up; see existence of each slot",
    } | ({} if region is None else {"ellipses": "3 standard deviations"})
