"""The study's table: settings and how many runs of each."""

from faintrack.studies.study import Setting
from faintrack.studies.superposed import runs, scene

AXES = {name: ("scan", "slot") for name in ("existence", "x", "y")}

SETTINGS = tuple(
    Setting(f"births{number}", run, 100, 4, AXES, scans=scene.SCANS, batch=1)
    for number, run in ((1, runs.births1), (2, runs.births2))
)
