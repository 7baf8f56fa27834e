"""Modules whose examples are left out where the program that they are for is not installed."""

from importlib.util import find_spec

collect_ignore = [] if find_spec("stonesoup") else ["faintrack/stonesoup"]
