"""After davey2008: grid, dynamic programming, particles and histogram PMHT for one target, at 12, 6 and 3 dB."""

from faintrack.studies.davey2008 import panels, rows
from faintrack.studies.davey2008.settings import SETTINGS
from faintrack.studies.study import Study

study = Study(
    "davey2008",
    "Grid, dynamic programming, particles and histogram PMHT for one target in an image",
    SETTINGS,
    rows.rows,
    panels.figures,
)
