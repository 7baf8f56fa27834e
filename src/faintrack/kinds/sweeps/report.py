"""Facts of a result of sweeps, as its report tells them."""

from faintrack.results.result import Result


def about(result: Result) -> dict[str, str]:
    """Facts by name."""
    data, sections = result.data, result.scenario
    windows = data.windows.values
    return {
        "sweeps": str(data.attrs["source"]),
        "number": f"{data.sizes['time']}, {data.attrs['scan_interval']:g} s apart",
        "first sweep": f"{data.attrs['first_scan_time']:g} s in its middle; times are from there",
        "range": f"{sections.sweeps.nearest:g} to {float(data.axis_range[-1]):g} m",
        "windows on echoes": f"{int(windows[-1])} after the last sweep, {int(windows.max())} at most",
    }
