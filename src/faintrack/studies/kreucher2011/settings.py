"""The study's table: settings and how many runs of each."""

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
    *(
        Setting(
            f"close_{level:g}{name}",
            runs.close_pass(separate=name != ""),
            800,
            16,
            ALONE,
            {"level": level},
            scans=scene.SCANS - runs.FROM,
            batch=8,
            address=f"close_{level:g}",
        )
        for level in scene.LEVELS
        for name in ("", "_separate")
    ),
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
    *(
        Setting(
            f"kept_{beams:g}{name}",
            runs.kept(separate=name != ""),
            400,
            8,
            ALONE,
            {"beams": beams},
            scans=scene.CROWD_SCANS,
            batch=8,
            address=f"kept_{beams:g}",
        )
        for beams in APART
        for name in ("", "_separate")
    ),
    Setting("four", runs.four, 1, 1, {**ESTIMATES, "log_place": ("scan", "x", "y")}, batch=1),
)
