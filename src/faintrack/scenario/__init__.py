"""What every scenario file has in common: sections, arrays, the plane of places on earth."""
