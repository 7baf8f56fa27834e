"""A tracker of Stone Soup that runs a scenario over data of any kind, scan by scan."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.tracker.base import Tracker
from stonesoup.types.track import Track

from faintrack.kinds.door import Moment, follow
from faintrack.results.tables import to_stonesoup
from faintrack.results.track import tracks_of
from faintrack.stonesoup.clock import date


class ScenarioTracker(Tracker):
    """Tracks in data, as `faintrack.follow` finds them, yielded as Stone Soup's trackers yield theirs.

    Every scan yields its time and the set of tracks in hand. A track is the same object from scan to scan and grows by
    a Gaussian state; one that has been dropped is no longer in the set. Its `id` is the label, `metadata["existence"]`
    the probability that the target exists, and `metadata["components"]` names the components of its states, each place
    followed by its rate.

    Attributes
    ----------
    data : a path or several, or data in memory, as `faintrack.follow` takes them.
    scenario : what to run: a path, a dictionary, a `Scenario`; defaults where not given.

    Raises
    ------
    InputError : data and scenario do not fit together; when the first scan is asked for.

    Notes
    -----
    Where the data do not tell when they begin, their times are taken for seconds since the start of 1970; those of
    `bearings_of` are.

    Examples
    --------
    >>> import numpy as np
    >>> import faintrack as ft
    >>> tracker = ScenarioTracker(ft.from_frames(np.random.default_rng(0).normal(size=(20, 24, 32))))
    >>> time, tracks = next(iter(tracker))
    >>> time, tracks
    (datetime.datetime(1970, 1, 1, 0, 0), set())
    """

    data: Any = Property(doc="Path or paths, or data in memory")
    scenario: Any = Property(default=None, doc="What to run: path, dictionary or Scenario")

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._moments: Iterator[Moment] | None = None
        self._known: dict[str, Track] = {}
        self._in_hand: set[Track] = set()

    @property
    def tracks(self) -> set[Track]:
        """In hand after the last scan."""
        return set(self._in_hand)

    def __next__(self) -> tuple[datetime, set[Track]]:
        if self._moments is None:
            self._moments = follow(self.data, self.scenario)
        data = next(self._moments).data
        if not data.attrs.get("start_time"):
            data = data.assign_attrs(start_time=date(float(data.attrs["first_scan_time"])).isoformat())
        self._in_hand = {self._grown(track) for track in to_stonesoup(tracks_of(data))}
        start = np.datetime64(str(data.attrs["start_time"]).removesuffix("Z"), "us").item()
        return start + timedelta(seconds=float(data.time[-1])), self.tracks

    def _grown(self, track: Track) -> Track:
        """The track of the same label, with what is new of it."""
        known = self._known.setdefault(track.id, track)
        if known is not track:
            for state, metadata in zip(track.states, track.metadatas, strict=True):
                known.append(state)
                known.metadata.update(metadata)
        return known
