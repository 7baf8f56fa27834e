"""Facts of a result of bearings, as its report tells them."""

import numpy as np

from faintrack.results.result import Result


def about(result: Result) -> dict[str, str]:
    """Facts by name."""
    data, section = result.data, result.scenario.bearings
    count = int(np.isfinite(data.reported).sum())
    sector = section.sector_deg
    return {
        "bearings": str(data.attrs["source"]),
        "scans": f"{data.sizes['time']}, {data.attrs['scan_interval']:.4g} s apart on average",
        "first scan": f"{data.attrs['first_scan_time']:g} s; times are from there",
        "observers": f"{data.sizes['observer']}, with {count / data.sizes['time']:.3g} bearings a scan",
        "detector": f"error {section.error_deg:g} degrees, detection probability {section.detection_probability:g}, "
        f"{section.false_per_scan:g} false bearings a scan and observer",
        "sector": "all around" if sector is None else f"{sector[0]:g} to {sector[1]:g} degrees clockwise",
    }
