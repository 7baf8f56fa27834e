"""The study's table: settings and how many runs of each."""

from faintrack.studies.stone2002 import periscope, simulation, tenet
from faintrack.studies.study import Setting

PERISCOPE_DB = 2
"""Signal to clutter at which the periscope's peak is nearest to the paper's."""


def periscope_name(scr_db: int) -> str:
    """Name of the setting of the periscope with this ratio of signal to clutter."""
    return f"periscope_{scr_db}"


SCAN = ("scan",)
PROFILES = {
    "power": ("scan", "range"),
    "over_range": ("scan", "range"),
    "over_rate": ("scan", "range_rate"),
    "path": SCAN,
    "rate": (),
}
POINTS = {"state": ("time", "component", "point"), "log_ratio": ("time", "point"), "truth": ("time", "component")}
PEAKS = {"peak": SCAN, "near": SCAN, "noise_peak": (), "noise_peak_highest": ()}

SETTINGS = (
    Setting("straight", simulation.straight, 1000, 250, PEAKS, scans=simulation.SCANS, batch=125),
    *(
        Setting(run.__name__, run, runs, quick, {"peak": SCAN, "log_ratio": SCAN}, scans=simulation.SCANS)
        for run, runs, quick in ((simulation.modelled, 4096, 512), (simulation.noise, 2048, 256))
    ),
    Setting("ending", simulation.ending, 4096, 512, {"at_state": ()}, scans=simulation.SCANS, batch=128),
    Setting("surfaces", simulation.picture, 1, 1, {"surface": ("scan", "position", "velocity")}, batch=1),
    *(
        Setting(
            periscope_name(scr_db),
            periscope.exposure,
            100,
            20 if scr_db == PERISCOPE_DB else 0,
            {"peak": (), "second_peak": ()},
            {"scr_db": scr_db},
            scans=periscope.SCANS,
            batch=10,
        )
        for scr_db in periscope.SCR_DB
    ),
    Setting("profiles", periscope.look, 1, 1, PROFILES, {"scr_db": PERISCOPE_DB}, scans=periscope.SCANS, batch=1),
    Setting("tenet_detection", tenet.detection, 200, 16, {"log_odds": SCAN, "error": SCAN}, scans=tenet.SCANS, batch=4),
    Setting("tenet_points", tenet.points, 1, 1, POINTS, batch=1),
    Setting("tenet_particle", tenet.by_particles, 200, 40, {"error": SCAN}, scans=tenet.CHALLENGE_SCANS, batch=8),
    Setting("tenet_grid", tenet.by_grid, 120, 16, {"error": SCAN}, scans=tenet.CHALLENGE_SCANS, batch=2),
)
