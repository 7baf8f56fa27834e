"""The examples of stone2002, section 4: a simulation, a periscope radar, Rayleigh pixels."""

from faintrack.studies.stone2002 import panels, rows
from faintrack.studies.stone2002.settings import SETTINGS
from faintrack.studies.study import Study

study = Study(
    "stone2002", "Likelihood ratio detection and tracking on grids and pixels", SETTINGS, rows.rows, panels.figures
)
