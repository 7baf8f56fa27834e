"""What sensors recorded, as values: recordings, frames, returns, bearings, records of several arrays."""
