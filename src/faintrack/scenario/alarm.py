"""Rules of when someone is to be called; `faintrack live` follows them."""

from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import Field, model_validator

from faintrack.scenario.section import FilePath, Pair, Section


class AlarmSection(Section):
    """When someone is called; once for each track.

    Attributes
    ----------
    name : of the alarm, for whoever is called.
    when : "declared", a track begins or comes into the sector or region.
    sector : bearings from the first to the second, in the direction in which they grow; degrees as results tell them.
        Everywhere where not given.
    region : least and largest value of numbers of a track, by the names that they have in states.csv:
        {x_m = [0, 500], y_m = [-200, 200]}. Everywhere where not given.
    longer_than : seconds that the track has been there without a break.
    webhook : address that the alarm is sent to, http or https; none where not given.
    secret_file : file with the secret that what is sent is signed with.
    """

    name: str = Field(default="alarm", min_length=1, max_length=80)
    when: Literal["declared"] = "declared"
    sector: Pair | None = None
    region: dict[str, Pair] | None = None
    longer_than: float = Field(default=0.0, ge=0)
    webhook: str | None = None
    secret_file: FilePath | None = None

    @model_validator(mode="after")
    def _is_whole(self) -> "AlarmSection":
        if self.webhook is not None:
            parts = urlsplit(self.webhook)
            if parts.scheme not in ("http", "https") or not parts.hostname:
                raise ValueError("webhook: expected an address that begins with http:// or https://")
        for name, (low, high) in (self.region or {}).items():
            if low >= high:
                raise ValueError(f"region.{name}: expected the smaller number first")
        if (self.webhook is None) != (self.secret_file is None):
            raise ValueError("webhook and secret_file: expected both or none")
        return self


Alarms = Annotated[tuple[AlarmSection, ...], Field(strict=False)]
"""Rules of a scenario; in a file a list of tables."""
