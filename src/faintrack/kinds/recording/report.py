"""Facts of a recording's result, as its report tells them."""

import numpy as np

from faintrack.results.result import Result
from faintrack.results.track import Track


def about(result: Result) -> dict[str, str]:
    """Facts by name."""
    data, scenario = result.data, result.scenario
    channels, band = scenario.array.channels, scenario.analysis.band
    above = scenario.target.elevation_deg
    used = sum(channel.gain != 0 for channel in channels)
    facts = {
        "recording": str(data.attrs["source"]),
        "start": data.attrs["start_time"] or "not known",
        "frames": f"{data.sizes['time']} of {scenario.analysis.frame:g} s",
        "band": "all frequencies" if band is None else f"{band[0]:g} to {band[1]:g} Hz",
        "array": f"{used} of {len(channels)} channels in use, {scenario.array.sound_speed:g} m/s",
        "bearings": f"degrees {data.beam.attrs['reference']}",
        "waves": "level" if above is None else f"{above[0]:g} to {above[1]:g} degrees above the horizon",
    }
    if "heading" in data:
        heading = np.unwrap(data.heading.values, period=360)
        facts["heading"] = f"{heading[0] % 360:.1f} degrees at the start, {heading.min() - heading[0]:+.1f} to "
        facts["heading"] += f"{heading.max() - heading[0]:+.1f} from there"
    if "starboard" in data:
        facts["sides"] = "; ".join(map(_sides, result.tracks)) or "no track"
    return facts


def _sides(track: Track) -> str:
    """Probabilities of both sides of a line, at the start of a track and at its end."""
    first, last = (float(track.mean["starboard"][scan]) for scan in (0, -1))
    return (
        f"track {track.label} to starboard {first:.2f}, to port {1 - first:.2f} at its start, {last:.2f} and "
        f"{1 - last:.2f} at its end"
    )
