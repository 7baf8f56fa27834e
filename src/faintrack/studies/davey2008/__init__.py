"""After davey2008: grid, dynamic programming and particles for one target in an image, at 12, 6 and 3 dB."""

from faintrack.studies.davey2008.pictures import figures
from faintrack.studies.davey2008.report import rows
from faintrack.studies.davey2008.settings import SETTINGS
from faintrack.studies.study import Study

study = Study(
    "davey2008", "Grid, dynamic programming and particles for one target in an image", SETTINGS, rows, figures
)
