"""The synthetic experiment of kreucher2011, section VII-A: several arrays, several targets, two of which pass close."""

from faintrack.studies.kreucher2011 import panels, rows
from faintrack.studies.kreucher2011.settings import SETTINGS
from faintrack.studies.study import Study

study = Study(
    "kreucher2011", "Several targets, followed by several passive arrays at once", SETTINGS, rows.rows, panels.figures
)
