"""Facts of a result of frames, as its report tells them."""

from faintrack.results.result import Result


def about(result: Result) -> dict[str, str]:
    """Facts by name."""
    data = result.data
    axes = [str(name) for name in data.surface.dims if str(name).startswith("axis_")]
    return {
        "frames": str(data.attrs["source"]),
        "number": f"{data.sizes['time']}, {data.attrs['scan_interval']:g} s apart",
        "first frame": f"{data.attrs['first_scan_time']:g} s; times are from there",
        "background": str(result.scenario.frames.background),
        **{
            f"axis {data[name].attrs['long_name']}": f"{data.sizes[name]} cells, {float(data[name][0]):g} to "
            f"{float(data[name][-1]):g} {data[name].attrs['units']}"
            for name in axes
        },
    }
