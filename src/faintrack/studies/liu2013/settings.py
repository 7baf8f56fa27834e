"""The study's table: settings and how many runs of each."""

import functools
from collections.abc import Callable
from typing import Any

from faintrack.studies.liu2013 import runs, scene
from faintrack.studies.study import Setting

GROUPS = {"paper": ("particle", "ipda", "immpda"), "bernoulli": ("bernoulli",), "particle": ("particle",)}
"""Methods that run together: a program is compiled for each, and workers share them."""
ALL = ("paper", "bernoulli")
"""Every method once."""

BIRTHS: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "start": (scene.around_start, ALL),
    "region": (scene.over_region, ALL),
    "along": (scene.along_bearings, ("bernoulli",)),
}
"""Where new targets are looked for, and which methods can."""

FALSE = (1, 20)
"""Expected numbers of false bearings beside the paper's."""
DETECTION = (90, 70)
"""Probabilities of detection beside the paper's; %."""
PARTICLES = (300, 1000, 10_000, 30_000)
"""Numbers of particles beside the paper's."""

AXES = {
    "log_odds": ("scan", "kind", "form"),
    "error": ("scan", "kind", "form"),
    "x": ("scan",),
    "y": ("scan",),
    "bearing": ("scan", "entry"),
    "there": ("scan", "entry"),
    "lost": (),
}
CAPACITY, CROWDED = 24, 56
"""Places for bearings in a scan, and where 20 are false: no more come once in a million scans."""


@functools.cache
def _program(group: str, births: str = "start", particles: int = scene.PARTICLES, capacity: int = CAPACITY) -> Any:
    """Runs with one compiled program."""
    return functools.partial(
        runs.follow, kinds=GROUPS[group], births=BIRTHS[births][0], particles=particles, capacity=capacity
    )


def _setting(
    name: str,
    group: str,
    full: int,
    quick: int = 0,
    false: float = scene.FALSE_PER_SCAN,
    detection: float = scene.DETECTION_PROBABILITY,
    spread: float = 0.0,
    cost: int = 1,
    batch: int = 100,
    **program: Any,
) -> Setting:
    parameters = {"false_per_scan": false, "detection_probability": detection, "spread": spread}
    # All methods see the same data.
    address = f"false_{false:g}_detection_{detection:g}"
    return Setting(f"{name}_{group}", _program(group, **program), full, quick, AXES, parameters, cost, batch, address)


def _quick(births: str, group: str) -> int:
    """The quick study is the paper's own: its three methods, births about the start."""
    return 100 if births == "start" and group == "paper" else 0


SETTINGS = (
    *(
        _setting(births, group, 300 if births == "along" else 1000, _quick(births, group), births=births)
        for births, (_, groups) in BIRTHS.items()
        for group in groups
    ),
    *(_setting("drawn", group, 300, spread=1.0) for group in ALL),
    *(
        _setting(f"false_{false}", group, 300, false=false, **({"capacity": CROWDED} if false > 5 else {}))
        for false in FALSE
        for group in ALL
    ),
    *(
        _setting(f"detection_{detection}", group, 300, detection=detection / 100)
        for detection in DETECTION
        for group in ALL
    ),
    *(
        _setting(f"particles_{count}", group, 100, cost=max(1, count // 3000), batch=10, particles=count)
        for count in PARTICLES
        for group in ("particle", "bernoulli")
    ),
)
