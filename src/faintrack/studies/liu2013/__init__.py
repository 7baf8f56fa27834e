"""The simulation of liu2013, section 5: bearings-only initiation in clutter, with particles and with the classics."""

from faintrack.studies.liu2013 import panels, rows
from faintrack.studies.liu2013.settings import SETTINGS
from faintrack.studies.study import Study

study = Study(
    "liu2013",
    "Bearings only: is there a target among false bearings, and where",
    SETTINGS,
    rows.rows,
    panels.figures,
    brief=True,
)
