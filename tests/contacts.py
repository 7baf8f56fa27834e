"""Contacts of an active sonar of targets among false ones, and of nothing, with the scenario that tracks them."""

import tomllib
from functools import cache
from typing import Any

import faintrack as ft
from faintrack.data.contacts import Contacts

PINGS, INTERVAL = 24, 30.0

SCENARIO = """
[contacts]
range = [200.0, 6000.0]
range_std = 25.0
bearing_std_deg = 1.5
detection_probability = 0.9
false_per_ping = 3.0
source = [0.0, 0.0]
receiver = [0.0, 0.0]
x = [-6000.0, 6000.0]
y = [-6000.0, 6000.0]
speed = 8.0

[filter]
particles = 2000
births = 2000

[simulation]
pings = 24
interval = 30.0
targets = [{x = -2500.0, y = 2000.0, vx = 5.0, vy = -2.0, start = 90.0}]
"""


def scenario(**sections: dict[str, Any]) -> Any:
    """The scenario, some fields of its sections replaced."""
    content = tomllib.loads(SCENARIO)
    for name, fields in sections.items():
        content[name] = content.get(name, {}) | fields
    return ft.Scenario(**content)


@cache
def drawn(present: bool = True, seed: int = 0) -> Contacts:
    """Contacts of all pings, with the target or without."""
    targets = {} if present else {"targets": []}
    contacts: Contacts = ft.simulate(scenario(simulation={"seed": seed} | targets))
    return contacts
