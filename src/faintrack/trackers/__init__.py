"""Trackers: beliefs turned into tracks with a beginning, an end and a label."""
