"""Bounds of what files may say, all in one place.

No header is believed before the data are seen: what a file claims is compared with what it holds, and what would take
a machine's memory or time is refused with both numbers. The bounds lie far beyond what arrays, cameras and radars
deliver, so that who meets one has a damaged file, or one that was made to do harm.
"""

MOST_CHANNELS = 10_000
"""Of a recording."""

LOWEST_RATE, HIGHEST_RATE = 1e-6, 1e10
"""Samples a second; Hz."""

FIRST_YEAR, LAST_YEAR = 1900, 2200
"""Of a date; nanoseconds since 1970 end in 2262."""

MOST_SAMPLES = 2**50
"""Of a channel, and frames of a sequence."""

MOST_CELLS = 2**26
"""Of one frame or image: 8192 by 8192, 256 MiB in single precision."""

MOST_HELD = 2**32
"""Bytes of an array that has to be held in memory as a whole."""

MOST_CHUNK = 2**29
"""Bytes of one chunk of HDF5 or Zarr, unpacked."""

MOST_UNPACKED = 1100
"""Bytes that one packed byte may become: deflate reaches 1032, and files of constant frames come near it."""

MOST_UNPACKED_CHUNK = 2**17
"""The same of packers that know no such bound (Blosc, Zstandard), chunk by chunk."""

MOST_FILES = 1_000_000
"""Images of a folder, pages of a TIFF file, members of an archive."""

MOST_TAGS = 4096
"""Entries of one TIFF page."""

MOST_FIELDS = 20_000
"""Columns of a table."""

LONGEST_FIELD = 10_000
"""Characters of a value in a table."""

LARGEST_TEXT = 2**26
"""Bytes of a description that is read whole: TOML, XML."""

MOST_NAMES = 4096
"""Arrays of a file, and attributes of each."""
