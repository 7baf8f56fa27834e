"""Data tracked as they come: streams in, tracks out while the recorder still runs.

A stream is an iterator of pieces (`faintrack.live.stream.Piece`): the time of its first sample, its values, and how
many samples are missing before it. Whatever brings them, standard input, a named pipe, UDP, a file that grows or a
recording played at any speed, fills one buffer of bounded size (`faintrack.live.buffer`), from which the one loop takes
scan after scan (`faintrack.live.watch`): the numbers are those of `faintrack.track` on the same samples.
"""
