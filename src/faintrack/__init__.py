"""Detect and follow targets too quiet to threshold, from raw sensor data.

The five names that a first session needs are here; everything else is in the modules that it belongs to. They are
loaded when they are first used, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from faintrack.errors import InputError
    from faintrack.io import read, read_array
    from faintrack.kinds.session import follow, track

__all__ = ["InputError", "follow", "read", "read_array", "track"]

_HOMES = {
    "InputError": "faintrack.errors",
    "follow": "faintrack.kinds.session",
    "read": "faintrack.io",
    "read_array": "faintrack.io",
    "track": "faintrack.kinds.session",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'faintrack' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
