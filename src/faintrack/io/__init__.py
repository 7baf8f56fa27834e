"""Reading and writing, the edge where files become values.

`read` opens recordings of every known format, `read_sequence` images and other frames, `read_returns` the returns of an
active sonar, `read_bearings` sets of bearings, `read_record` bearing-time records, `read_array` a description of an
array, `write_recording` stores samples as they arrive, `write_returns` and `write_bearings` returns and bearings, and
`faintrack.io.results` keeps what came out. The libraries behind the formats are imported when a file needs them, so
that importing this package stays cheap and a missing library matters only to those who use its format.
"""

from faintrack.io.arrays import match_channels, read_array
from faintrack.io.bearings import read_bearings, write_bearings
from faintrack.io.recordings import read
from faintrack.io.records import read_record
from faintrack.io.returns import read_returns, write_returns
from faintrack.io.sequences import read_sequence
from faintrack.io.write_recordings import write_recording

__all__ = [
    "match_channels",
    "read",
    "read_array",
    "read_bearings",
    "read_record",
    "read_returns",
    "read_sequence",
    "write_bearings",
    "write_recording",
    "write_returns",
]
