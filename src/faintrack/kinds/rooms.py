"""Functions that are imported when they are called, so that a kind costs nothing until its data come."""

from collections.abc import Callable
from importlib import import_module
from typing import Any


def room(module: str, name: str) -> Callable[..., Any]:
    """Function of a module that is imported when it is first called.

    Parameters
    ----------
    module : by its full name.
    name : of the function.

    Examples
    --------
    >>> room("math", "hypot")(3.0, 4.0)
    5.0
    """

    def call(*arguments: Any, **options: Any) -> Any:
        return getattr(import_module(module), name)(*arguments, **options)

    return call
