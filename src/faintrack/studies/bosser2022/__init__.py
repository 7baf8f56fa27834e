"""The evaluation of bosser2022: both scenarios, its three methods and a fourth that does not know the noise."""

from faintrack.studies.bosser2022 import panels, rows
from faintrack.studies.bosser2022.settings import SETTINGS
from faintrack.studies.study import Study

study = Study("bosser2022", "Track-before-detect on raw hydrophone samples", SETTINGS, rows.rows, panels.figures)
