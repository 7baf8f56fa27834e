"""The study's table: settings and how many runs of each."""

from faintrack.studies.davey2008 import runs, scene
from faintrack.studies.study import Setting

SNR_DB = (12, 6, 3)
"""Of davey2008; at the target's peak."""

AXES: dict[str, tuple[str, ...]] = {"speed": ()} | {
    f"{method}_{what}": ("scan",) for method in runs.METHODS for what in ("statistic", "error")
}


def noise(snr_db: int) -> str:
    """Name of the setting without a target, for trackers that look for one of this ratio."""
    return f"noise_{snr_db}"


def target(snr_db: int) -> str:
    """Name of the setting with a target of this ratio."""
    return f"target_{snr_db}"


SETTINGS = tuple(
    Setting(
        name(snr_db),
        runs.compare,
        full,
        quick,
        AXES,
        {"snr_db": snr_db, "present": name is target},
        scans=scene.SCANS,
        batch=1,
    )
    for snr_db in SNR_DB
    for name, full, quick in ((noise, 400, 40), (target, 200, 20))
)
