"""Sensors: geometry, and which part of a scan a target's state reaches."""
