"""Five targets whose signals add, in one picture of 144 sensors: multi-Bernoulli particles beside published filters."""

from faintrack.studies.study import Study
from faintrack.studies.superposed import panels, rows
from faintrack.studies.superposed.settings import SETTINGS

study = Study("superposed", "Five targets whose signals add, in one picture", SETTINGS, rows.rows, panels.figures)
