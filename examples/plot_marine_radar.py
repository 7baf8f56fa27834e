r"""
Ships that hardly move
======================

A navigation radar turns eighteen times, 3 s a turn. Ships at 32 km show as blobs 10 samples long, and move by 4 to 8
samples in all that time, among hundreds of echoes that stay. What tells them apart is a second hypothesis: the echo
stands still. :doc:`/howto/track_radar` tells how; the scenario has four lines.

The numbers are those of ``examples/marine_radar.py``, which needs the recording and some minutes.
"""

import json
from pathlib import Path

root = Path() if Path("docs/validation_data").exists() else Path("..")
print((root / "examples/scenario_marine_radar.toml").read_text(encoding="utf-8"))
known = json.loads((root / "docs/validation_data/marine_radar.json").read_text(encoding="utf-8"))

# %%
# What moves, in the whole picture
# --------------------------------

for track in known["tracks"]:
    place = f"spoke {track['spoke']:.0f}, sample {track['sample']:.1f}"
    print(
        f"track {track['label']}: {place}, {track['inbound_m_s']:.1f} m/s inbound, existence {track['existence']:.3f}"
    )

# %%
# The same sweeps shuffled in time
# --------------------------------
# They hold the same echoes with the same fluctuations, and nothing that moves steadily.

for name, counts in known["shuffled_declared"].items():
    print(f"{name}: {sum(counts)} tracks in {len(counts)} orders")

# %%
# Where, in the picture
# ---------------------
# Drawn where the recording is at hand.

file = root / "../shared/data/marine_radar/navico_halo_lauwersoog_38km.npz"
if file.exists():
    import faintrack as ft

    result = ft.track(file, root / "examples/scenario_marine_radar.toml")
    figure = result.plot()
else:
    print(f"{file} is absent: no picture.")
