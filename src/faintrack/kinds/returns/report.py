"""Facts of a result of returns, as its report tells them."""

import numpy as np
import xarray as xr

from faintrack.kinds.returns.build import expected_returns, sonar_axes
from faintrack.kinds.returns.pairs import pairs_of_result
from faintrack.kinds.returns.sections import SonarSection
from faintrack.results.result import Result


def about(result: Result) -> dict[str, str]:
    """Facts by name."""
    data, pairs = result.data, pairs_of_result(result)
    one = len(pairs) == 1
    facts = {
        "returns": str(data.attrs["source"]),
        "pings": f"{data.sizes['time']}, {data.attrs['scan_interval']:g} s apart",
        "first ping": f"{data.attrs['first_scan_time']:g} s; times are from there",
        "returns a ping": f"{float(data.returns.mean()):.4g} on average, {int(data.returns.max())} at most; "
        f"{sum(expected_returns(pair.table) for pair in pairs):.4g} expected of noise alone",
    }
    for pair in pairs:
        part = data if one else data.sel(pair=pair.name)
        facts |= {
            f"{pair.name}, {name}" if pair.name else name: fact for name, fact in _of_pair(part, pair.table).items()
        }
    facts["grid"] = " and ".join(
        f"{data.sizes[x]} x {data.sizes[y]} cells of {_cell(data[x])} x {_cell(data[y])}"
        for x, y in (("axis_x", "axis_y"), ("axis_vx", "axis_vy"))
    )
    return facts


def _of_pair(data: xr.Dataset, sonar: SonarSection) -> dict[str, str]:
    """Facts of one source and one receiver."""
    delay, doppler = sonar_axes(sonar)
    assert sonar.pulse is not None
    sweep = f"sweep of {sonar.pulse.bandwidth:g} Hz" if sonar.pulse.bandwidth else "constant frequency"
    bins = [f"{delay.count} delays from {delay.first:g} to {delay.last:g} s", f"{sonar.beams} beams"]
    bins.append(
        "no Doppler" if doppler is None else f"{doppler.count} shifts from {doppler.first:g} to {doppler.last:g} Hz"
    )
    return {
        "background": _background(data),
        "pulse": f"{sonar.pulse.frequency:g} Hz, {sonar.pulse.duration:g} s, {sweep}",
        "bins": ", ".join(bins),
        "threshold": f"{sonar.threshold_db:g} dB, for a target of {sonar.snr_db:g} dB",
        **{name: _place(data, name) for name in ("source", "receiver")},
    }


def _background(data: xr.Dataset) -> str:
    """What was learnt of returns without a target."""
    if "tail_shape" not in data:
        return "noise of mean 1, not learnt"
    returns, shape = float(data.background_returns[-1]), float(data.tail_shape[-1])
    return f"learnt: {returns:.4g} returns in the last ping, in the bins that are read; a tail of shape {shape:.2g}"


def _place(data: xr.Dataset, platform: str) -> str:
    """Where a platform is, or from where to where it moves."""
    x, y = (data[f"{platform}_{name}"].values.astype(float) / 1000 for name in "xy")
    places = [f"{east:.4g} km east, {north:.4g} km north" for east, north in ((x[0], y[0]), (x[-1], y[-1]))]
    return places[0] if np.ptp(x) == np.ptp(y) == 0 else f"from {places[0]} to {places[1]}"


def _cell(axis: xr.DataArray) -> str:
    """Width of a cell with its unit."""
    return f"{float(axis[1] - axis[0]) if axis.size > 1 else 0:.4g} {axis.attrs['units']}"
