"""The study's table: settings and how many runs of each."""

import functools

from faintrack.studies.bosser2022 import runs, scene
from faintrack.studies.study import Setting

SNR_DB = (-34, -32, -31, -30, -28, -27, -26, -25, -20, -15)
"""Of scenario I."""
QUICK_DB = (-34, -32, -31, -27, -26, -15)
"""Of those, what the quick study runs."""

PER_SCAN = {"log_odds": ("scan", "method"), "error": ("scan", "method"), "bearing_std": ("scan", "method")}
WALD = {"log_odds": ("scan", "method"), "log_ratio": ("scan", "method")}

VARIANT_RUNS = {
    (name, wald): functools.partial(runs.variant, name=name, wald=wald)
    for name in runs.VARIANTS
    for wald in (False, True)
}


def scenario_name(snr_db: int) -> str:
    """Name of the setting of scenario I with this SNR."""
    return f"scenario1_{-snr_db}"


SETTINGS = (
    Setting("modelled_born", runs.modelled, 1536, 64, WALD, {"born": 1.0}, scene.NOISE_SCANS),
    Setting("modelled_none", runs.modelled, 512, 32, WALD, {"born": 0.0}, scene.NOISE_SCANS),
    *(
        Setting(
            scenario_name(snr_db),
            runs.scenario_one,
            1000,
            32 if snr_db in QUICK_DB else 0,
            PER_SCAN,
            {"snr_db": snr_db},
            scene.SCANS,
        )
        for snr_db in SNR_DB
    ),
    Setting("noise", runs.noise, 30_000, 96, {"highest": ("method",)}, {}, scene.NOISE_SCANS),
    Setting("guided_15", runs.guided, 1000, 0, PER_SCAN, {"snr_db": -15}, scene.SCANS),
    Setting("approach", runs.approach, 1000, 8, PER_SCAN, {}, len(scene.approach_snr_db()), batch=8),
    *(
        Setting(
            f"variant_{name}_{'wald' if wald else 'scenario1'}",
            VARIANT_RUNS[name, wald],
            256,
            0,
            WALD if wald else PER_SCAN,
            {},
            scene.NOISE_SCANS if wald else scene.SCANS,
        )
        for name in runs.VARIANTS
        for wald in (True, False)
    ),
)
