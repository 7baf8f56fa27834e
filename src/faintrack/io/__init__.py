"""Reading and writing recordings and arrays, the edge where files become values.

`read` opens recordings of every known format, `read_array` a description of an array, and `write_recording`
stores samples as they arrive. The libraries behind the formats are imported when a file needs them, so that
importing this package stays cheap and a missing library matters only to those who use its format.
"""

from faintrack.io.arrays import read_array
from faintrack.io.recordings import read
from faintrack.io.write_recordings import write_recording

__all__ = ["read", "read_array", "write_recording"]
