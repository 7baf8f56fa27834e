"""Facts of a recording's result, as its report tells them."""

from faintrack.results.result import Result


def about(result: Result) -> dict[str, str]:
    """Facts by name."""
    data, scenario = result.data, result.scenario
    channels, band = scenario.array.channels, scenario.analysis.band
    above = scenario.target.elevation_deg
    used = sum(channel.gain != 0 for channel in channels)
    return {
        "recording": str(data.attrs["source"]),
        "start": data.attrs["start_time"] or "not known",
        "frames": f"{data.sizes['time']} of {scenario.analysis.frame:g} s",
        "band": "all frequencies" if band is None else f"{band[0]:g} to {band[1]:g} Hz",
        "array": f"{used} of {len(channels)} channels in use, {scenario.array.sound_speed:g} m/s",
        "bearings": f"degrees {data.beam.attrs['reference']}",
        "waves": "level" if above is None else f"{above[0]:g} to {above[1]:g} degrees above the horizon",
    }
