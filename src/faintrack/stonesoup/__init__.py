"""faintrack within Stone Soup, and its detections within faintrack: the plug-in `stonesoup.plugins.faintrack`.

- `ScenarioTracker` is a tracker of Stone Soup that runs a scenario over data: it yields the time and the tracks in
  hand, as Stone Soup's own trackers do, for their metrics, writers and plots.
- `BearingsReader` and `ReturnsReader` are detection readers of Stone Soup over what faintrack reads.
- `bearings_of` turns detections of Stone Soup's simulators, sensors and readers into bearings that faintrack tracks.

Tracks of a result that is there already: `faintrack.results.tables.to_stonesoup`. Stone Soup is not a part of
faintrack's installation (`pip install "faintrack[stonesoup]"`); nothing else in the package imports this folder.
"""

try:
    import stonesoup  # noqa: F401
except ImportError as error:
    raise ImportError(
        'faintrack.stonesoup needs Stone Soup, which is not installed: pip install "faintrack[stonesoup]".'
    ) from error

from faintrack.stonesoup.detections import bearings_of
from faintrack.stonesoup.readers import BearingsReader, ReturnsReader
from faintrack.stonesoup.tracker import ScenarioTracker

__all__ = ["BearingsReader", "ReturnsReader", "ScenarioTracker", "bearings_of"]
