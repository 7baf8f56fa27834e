"""The example of aughenbaugh2010, section 5: five ways to average a likelihood over the cells of a grid."""

from faintrack.studies.aughenbaugh2010 import panels, rows
from faintrack.studies.aughenbaugh2010.settings import SETTINGS
from faintrack.studies.study import Study

study = Study(
    "aughenbaugh2010", "Active sonar: likelihoods sampled where the returns are", SETTINGS, rows.rows, panels.figures
)
