r"""
How much noise a source survives
================================

Twenty minutes of an infrasound array, four microphones, several sources one after the other. White noise is added in
steps of 3 dB until each source is lost, once by track-before-detect, once by detect-and-track. Both have the threshold
that one draw in twenty passes in the quiet parts of the recording.

The counts are those of ``examples/infrasound_noise.py``, which needs the recording and some minutes.
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from faintrack.metrics.intervals import binomial_interval

folder = Path("docs") if Path("docs/validation_data").exists() else Path("../docs")
result = json.loads((folder / "validation_data" / "infrasound_noise.json").read_text())
added_db, draws = np.array(result["added_db"]), result["draws"]
sources = [name for name in result["found"]["bernoulli"] if name != "quiet"]

# %%
# Share of the noise draws in which each source is found
# ------------------------------------------------------
# Shaded: 95 % intervals of the share, from the number of draws.

labels = {"bernoulli": "track before detect", "cfar": "CFAR and Kalman filter"}
colours = {"bernoulli": "#0072B2", "cfar": "#E69F00"}
figure, axes = plt.subplots(2, 2, figsize=(9, 6), sharex=True, sharey=True, layout="constrained")
for axis, name in zip(axes.flat, sources, strict=True):
    for method, label in labels.items():
        hits = np.array(result["found"][method][name])
        low, high = binomial_interval(hits, draws)
        axis.plot(added_db, hits / draws, color=colours[method], marker="o", ms=4, label=label)
        axis.fill_between(added_db, low, high, color=colours[method], alpha=0.2, lw=0)
    axis.set_title(name)
    axis.axhline(0.5, color="0.7", lw=0.8)
for axis in axes[1]:
    axis.set_xlabel("added noise over the recording's own (dB)")
for axis in axes[:, 0]:
    axis.set_ylabel("share of draws found")
axes[0, 0].legend()


# %%
# Where each source is lost
# -------------------------


def lost_at(hits: np.ndarray) -> str:
    """Added noise at which the share falls through one half."""
    share = np.minimum.accumulate(hits / draws)
    if share[0] < 0.5:
        return "not found"
    return f"{np.interp(-0.5, -share, added_db):.1f} dB"


for name in sources:
    print(
        name + ":",
        *(f"{label} {lost_at(np.array(result['found'][method][name]))};" for method, label in labels.items()),
    )
