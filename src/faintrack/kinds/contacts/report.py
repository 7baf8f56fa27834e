"""Facts of a result of contacts, as its report tells them."""

import numpy as np

from faintrack.results.result import Result


def about(result: Result) -> dict[str, str]:
    """Facts by name."""
    data, section = result.data, result.scenario.contacts
    count = int(np.isfinite(data.distance).sum())
    several = data.sizes["pair"] > 1
    ends, error, unit = section.delay, section.delay_std, "s"
    if section.range is not None:
        ends, error, unit = section.range, section.range_std, "m"
    facts = {
        "contacts": str(data.attrs["source"]),
        "pings": f"{data.sizes['time']}, {data.attrs['scan_interval']:.4g} s apart on average, with "
        f"{count / data.sizes['time']:.3g} contacts each",
        "first ping": f"{data.attrs['first_scan_time']:g} s; times are from there",
        "detector": f"{'range' if unit == 'm' else 'delay'} {ends[0]:g} to {ends[1]:g} {unit}, error {error:g} {unit}; "
        f"error of the bearing {section.bearing_std_deg:g} degrees; detection probability "
        f"{section.detection_probability:g}, {section.false_per_ping:.3g} false contacts a ping"
        + (" of a source and a receiver" if several else ""),
        "Doppler": "not measured"
        if section.doppler is None
        else f"{section.doppler[0]:g} to {section.doppler[1]:g} Hz, error {section.doppler_std:g} Hz",
    }
    if section.sector_deg is not None:
        facts["sector"] = f"{section.sector_deg[0]:g} to {section.sector_deg[1]:g} degrees clockwise"
    if several:
        facts["pairs"] = ", ".join(str(name) for name in data.pair.values)
    facts["region"] = (
        f"{section.x[0] / 1000:g} to {section.x[1] / 1000:g} km east, "
        f"{section.y[0] / 1000:g} to {section.y[1] / 1000:g} km north"
    )
    return facts
