"""What came out: every scan as named variables with units, and tracks."""
