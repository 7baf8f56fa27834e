"""Metrics: how far what was found lies from the truth, and how sure a number from so many runs is."""
