"""What a watch says of its own numbers: what was left out or assumed, and where data are not as the model has them."""

import re
import time
from collections.abc import Iterable
from dataclasses import dataclass, field

from faintrack.kinds.door import Moment
from faintrack.live.watching import Tell, Watching

PAUSE = 10.0
"""Seconds between two looks at remarks."""


@dataclass
class Doubts:
    """Sentences that are told once, and again at the end of a part where they have come to count more.

    Attributes
    ----------
    watch : whose they are.
    tell : is called with events.
    """

    watch: Watching
    tell: Tell
    _said: dict[str, str] = field(default_factory=dict)
    _looked: float = -PAUSE
    _part: float | None = None

    def look(self, moment: Moment, part: float) -> None:
        """After a scan: remarks that have come up, and misfits where a part of so many seconds ends."""
        if time.monotonic() - self._looked > PAUSE:
            self.tell_remarks(self.watch.remarks())
            self._looked = time.monotonic()
        self._part = moment.time if self._part is None else self._part
        if moment.time - self._part >= part:
            self._part = None
            self.watch.close(moment.checkpoint.state)
            self.tell_all()

    def tell_remarks(self, sentences: Iterable[str]) -> None:
        """Tell remarks that are new."""
        self._tell("remark", sentences, again=False)

    def tell_all(self) -> None:
        """Tell all remarks and misfits that are new or have changed."""
        self._tell("misfit", self.watch.misfits(), again=True)
        self._tell("remark", self.watch.remarks(), again=True)

    def _tell(self, event: str, sentences: Iterable[str], again: bool) -> None:
        for text in sentences:
            what = without_numbers(text)
            if what not in self._said or (again and self._said[what] != text):
                self.tell({"event": event, "text": text})
                self._said[what] = text


def without_numbers(sentence: str) -> str:
    """What a sentence says, whatever it counts.

    Examples
    --------
    >>> without_numbers("3 lines are no numbers.") == without_numbers("12 lines are no numbers.")
    True
    """
    return re.sub(r"[0-9][0-9.,e+-]*", "", sentence)
