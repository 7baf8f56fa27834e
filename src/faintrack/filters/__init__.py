"""Filters: how a belief is started and carried forward in time."""
