"""The study's table: settings and how many runs of each."""

from faintrack.studies.stone2002 import simulation
from faintrack.studies.study import Setting

SETTINGS = (
    Setting(
        "straight",
        simulation.straight,
        1000,
        250,
        {"peak": ("scan",), "near": ("scan",), "noise_peak": (), "noise_peak_highest": ()},
        scans=simulation.SCANS,
        batch=125,
    ),
    *(
        Setting(run.__name__, run, runs, quick, {"peak": ("scan",), "log_ratio": ("scan",)}, scans=simulation.SCANS)
        for run, runs, quick in ((simulation.modelled, 4096, 512), (simulation.noise, 2048, 256))
    ),
    Setting("ending", simulation.ending, 4096, 512, {"at_state": ()}, scans=simulation.SCANS, batch=128),
    Setting("surfaces", simulation.picture, 1, 1, {"surface": ("scan", "position", "velocity")}, batch=1),
)
