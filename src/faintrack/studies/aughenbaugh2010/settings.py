"""The study's table: settings and how many runs of each."""

from faintrack.studies.aughenbaugh2010 import runs, scene
from faintrack.studies.study import Setting

METHODS = ("guided", "random1", "random5", "guided_fine", "random1_fine")
"""The paper's five, by their keys."""

PULSES = ("fm", "cw")

BEYOND = {
    "cell_particles": runs.by_cell_particles,
    "stationary_birth": runs.by_stationary_birth,
    "unknown_snr": runs.by_unknown_snr,
    "particles": runs.by_particles(cell_means=False),
    "particles_guided": runs.by_particles(cell_means=True),
}
"""FM alone: what the paper leaves open."""

AXES = {name: ("scan",) for name in ("log_odds", "error", "velocity_error", "returns", "lost", "samples")}


COST = {"guided": 1, "reduced": 1, "guided_fine": 4, "random1": 3, "random5": 12, "random1_fine": 14}
"""What a run takes beside those of other settings."""


def _run(pulse: str, method: str) -> runs.Run:
    cells = scene.FINE if method.endswith("_fine") else scene.BASE
    if method.startswith("random"):
        return runs.by_random(pulse, cells, int(method[len("random")]))
    return runs.by_guided(pulse, cells, reduced=method == "reduced")


def _setting(pulse: str, method: str, run: runs.Run, full: int, quick: int, cost: int) -> Setting:
    axes = {**AXES, "snr": ("scan", "snr_db")} if method == "unknown_snr" else AXES
    # All methods of a pulse see the same data. One run at a time: it has a core's cache to itself.
    return Setting(f"{pulse}_{method}", run, full, quick, axes, scans=cost, batch=1, address=pulse)


SETTINGS = (
    *(
        _setting(pulse, method, _run(pulse, method), 150, 10, COST[method])
        for pulse in PULSES
        for method in (*METHODS, "reduced")
    ),
    *(_setting("fm", name, run, 50, 0, 6) for name, run in BEYOND.items()),
)
