"""Kinds of data, one room each, and one table of them.

A room holds everything that is known of its kind, gathered in one `faintrack.kinds.kind.Kind`, which is called `KIND`
in the module that the table names. A kind of your own is one more line: `KINDS["mine"] = "my_package.my_kind"`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from faintrack.errors import InputError

if TYPE_CHECKING:
    from faintrack.kinds.kind import Kind

KINDS = {
    "recording": "faintrack.kinds.recording",
    "frames": "faintrack.kinds.frames",
    "returns": "faintrack.kinds.returns",
    "bearings": "faintrack.kinds.bearings",
    "records": "faintrack.kinds.records",
    "contacts": "faintrack.kinds.contacts",
    "sweeps": "faintrack.kinds.sweeps",
}
"""Name of each kind, and the module whose `KIND` it is."""


def kinds() -> "list[Kind]":
    """All kinds, in the order of the table."""
    return [import_module(module).KIND for module in KINDS.values()]


def kind_named(name: str, source: object = None) -> "Kind":
    """The kind of this name.

    Parameters
    ----------
    name : in the table.
    source : where the name comes from, for the message.

    Raises
    ------
    InputError : there is none.
    """
    if name not in KINDS:
        where = "" if source is None else f"{source}: "
        raise InputError(f"{where}kind is {name!r}; expected one of {', '.join(KINDS)}.")
    kind: Kind = import_module(KINDS[name]).KIND
    return kind
