"""The study's table: settings and how many runs of each."""

from collections.abc import Callable, Iterator

from faintrack.studies.kreucher2011 import runs, scene
from faintrack.studies.study import Setting

SLOTS = {name: ("scan", "slot") for name in ("x", "y", "joint")}

TRUE = {name: ("scan", "target") for name in ("true_x", "true_y")}

ESTIMATES = {
    **SLOTS,
    **TRUE,
    "label": ("scan", "slot"),
    "existence": ("scan", "slot"),
    "detection": ("scan", "detector"),
    "full": ("scan",),
}

WHOLE = {**ESTIMATES, **{name: ("scan", "target", "component") for name in ("tracked", "exact")}}

ALONE = {**SLOTS, **TRUE, "active": ("scan", "slot")}

COUNTS = (0, 1, 2, 3, 4, 6, 8, 10)
"""Targets at once."""

APART = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0)
"""Beams between two targets side by side."""

DECLARING = 60
"""Scans of runs that ask when targets are declared."""

LEVEL = {"level": scene.LEVEL}


def _near(
    name: str, run: Callable[[bool], runs.Run], full: int, quick: int, of: str, values: tuple[float, ...], scans: int
) -> Iterator[Setting]:
    """Trackers that start near the truth, updated jointly and never so, on the same data."""
    for value in values:
        for how in ("", "_separate"):
            key = f"{name}_{value:g}"
            yield Setting(key + how, run(how != ""), full, quick, ALONE, {of: value}, scans, batch=8, address=key)


SETTINGS = (
    Setting("synthetic", runs.whole(scene.SPEED), 100, 3, WHOLE, LEVEL, scans=9 * scene.SCANS, batch=1),
    *(
        Setting(name, run, 100, quick, WHOLE, LEVEL, scans=scene.SCANS, batch=1, address="synthetic")
        for name, run, quick in (
            ("coarse", runs.whole(scene.COARSE), 2),
            ("coarse_separate", runs.whole(scene.COARSE, separate=True), 2),
        )
    ),
    *(
        Setting(
            f"level_{level:g}",
            runs.whole(scene.COARSE, scans=DECLARING),
            100,
            0,
            WHOLE,
            {"level": level},
            scans=DECLARING,
            batch=1,
            address="synthetic",
        )
        for level in scene.LEVELS
    ),
    *_near("close", runs.close_pass, 800, 16, "level", scene.LEVELS, scene.SCANS - runs.FROM),
    *(
        Setting(f"crowd_{count}", runs.crowd, 100, 0, ESTIMATES, {"count": count}, scans=scene.CROWD_SCANS, batch=1)
        for count in COUNTS
    ),
    *(
        Setting(
            f"found_{beams:g}", runs.detected, 100, 0, ESTIMATES, {"beams": beams}, scans=scene.CROWD_SCANS, batch=1
        )
        for beams in APART
    ),
    *_near("kept", runs.kept, 400, 8, "beams", APART, scene.CROWD_SCANS),
    Setting("four", runs.four, 1, 1, {**ESTIMATES, "log_place": ("scan", "x", "y")}, batch=1),
)
