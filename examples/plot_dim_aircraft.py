r"""
How dim an aircraft may be
==========================

Five infrared sequences of a small aircraft in front of trees, roads and roofs, filmed by a camera that follows it. They
are taken as they are and with white noise added, until the aircraft stands 3, 2 and 1 deviations above the noise of its
own pixel. Track-before-detect is held against the best single frame at equal false alarms: each has the threshold that
one frame in a hundred passes in the same sequence with the aircraft painted over. The tracker's settings for a sequence
are chosen on the other four.

The numbers are those of ``examples/dim_aircraft.py``, which needs the sequences and some minutes.
"""

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from dim_aircraft import added_deviation, averaged, keep, tracker
from faintrack.beliefs.grids import surface
from faintrack.filters.run import run
from faintrack.sensors.cells import CellScan
from faintrack.signal.background import Whitening

root = Path() if Path("docs/validation_data").exists() else Path("..")
measured = json.loads((root / "docs/validation_data/dim_aircraft.json").read_text())
rows = measured["rows"]
labels = {
    "track": ("track before detect", "#0072B2"),
    "frame": ("single frame, local contrast", "#E69F00"),
    "frame, same background": ("single frame, tracker's background", "#009E73"),
}
contrasts = [None, 3.0, 2.0, 1.0]

# %%
# Share of frames in which the aircraft is reported within 3 pixels
# -----------------------------------------------------------------
# Thin lines: each sequence, mean over the draws of the noise. Thick: mean over sequences.


def shares_of(method: str, contrast: float | None) -> list[float]:
    """Of every sequence, mean over the draws."""
    chosen = [row for row in rows if (row["method"], row["contrast"]) == (method, contrast)]
    return [float(np.mean([draw["share"] for draw in row["draws"]])) for row in chosen]


figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
for method, (label, colour) in labels.items():
    shares = np.array([shares_of(method, contrast) for contrast in contrasts])
    axis.plot(shares, color=colour, lw=0.7, alpha=0.6)
    axis.plot(shares.mean(axis=1), color=colour, lw=2.5, marker="o", label=label)
axis.set_xticks(range(len(contrasts)), ["as it is", "3", "2", "1"])
axis.set_xlabel("contrast of the aircraft (deviations of the noise)")
axis.set_ylabel("share of frames found")
axis.legend()

# %%
# Time to declare and false tracks
# --------------------------------
# Median frame of the first report near the aircraft over all sequences and draws, never counting as never; false tracks
# a sequence, runs of frames that report another place.

for contrast in contrasts:
    for method, (label, _) in labels.items():
        draws = [
            draw for row in rows if (row["contrast"], row["method"]) == (contrast, method) for draw in row["draws"]
        ]
        first = np.median([np.inf if draw["declared"] is None else draw["declared"] for draw in draws])
        share, false = (np.mean([draw[name] for draw in draws]) for name in ("share", "false_tracks"))
        declared = f"declared at frame {first:.0f}" if np.isfinite(first) else "not declared"
        print(f"contrast {contrast or 'as it is'}, {label}: share {share:.2f}, {declared}, {false:.1f} false tracks")

# %%
# What it looks like
# ------------------
# One frame of sequence 10 at contrast 3; the log of the likelihood ratio surface after it; reported and true places of
# the frames up to there. Drawn where the sequences are at hand.

file, last = root / "../shared/data/ir_dim_aircraft/sequence10.npz", 70
if file.exists():
    data = np.load(file)
    frames, truth = data["frames"].astype(np.float32), data["truth_xy"].astype(int)
    deviation, _ = added_deviation(frames, truth, 3.0)
    frames = frames + deviation * np.random.default_rng(0).normal(size=frames.shape).astype(np.float32)
    settings = measured["chosen"]["sequence10"]
    residuals, _ = Whitening().whiten(jnp.asarray(frames[: last + 1]))
    scans = CellScan(jnp.arange(last + 1, dtype=jnp.float32), residuals)
    filter, likelihood = tracker(frames.shape[1:], tuple(settings["levels"]), settings["freedom"])
    belief, (odds, x, y), _ = run(filter, likelihood, scans, jax.random.key(0), keep)
    (threshold,) = (
        row["threshold"]
        for row in rows
        if (row["sequence"], row["contrast"], row["method"]) == ("sequence10", 3.0, "track")
    )
    reported = averaged(np.asarray(odds), settings["memory"]) > threshold

    figure, axes = plt.subplots(1, 3, figsize=(11, 3.8), layout="constrained")
    axes[0].imshow(frames[last], cmap="gray")
    axes[0].set_title(f"frame {last} with noise")
    picture = axes[1].imshow(surface(belief)[:, :, 0, 0], vmin=-25, vmax=5)
    figure.colorbar(picture, label="log likelihood ratio", shrink=0.8)
    axes[1].set_title("surface after it")
    for axis in axes[:2]:
        axis.plot(*truth[last], "o", ms=14, mfc="none", mec="#D55E00")
    axes[2].plot(*truth[: last + 1].T, color="0.6", lw=3, label="truth")
    axes[2].plot(x[reported], y[reported], ".", color="#0072B2", label="reported")
    axes[2].set(xlim=(95, 130), ylim=(165, 135), aspect="equal", title="track (pixels)")
    axes[2].legend()
else:
    print(f"{file} is absent: no picture.")
