"""Scenarios: what to run, as a validated file, and the objects that it describes."""

from faintrack.scenario.model import Scenario, read, to_toml

__all__ = ["Scenario", "read", "to_toml"]
