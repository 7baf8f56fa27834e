"""How dim an aircraft may be: track before detect against the best single frame, on real infrared sequences.

Five sequences of 100 frames, as they are and with white noise added until the contrast of the aircraft, its residual
over the local noise at the true pixel (median over the frames), is 3, 2 and 1. Both methods have the threshold that one
frame in a hundred passes in the same sequence with the aircraft painted over, under other draws of the noise. Writes
the numbers that `plot_dim_aircraft.py` draws:

    python examples/dim_aircraft.py ../shared/data/ir_dim_aircraft --out docs/validation_data/dim_aircraft.json
"""

import argparse
import json
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from faintrack.axis import Axis
from faintrack.belief import Belief, mode
from faintrack.filters.grid import GridFilter
from faintrack.filters.run import run
from faintrack.filters.separable import separable
from faintrack.grids import Grid
from faintrack.likelihoods.cells import CellLikelihood, gaussian, gaussian_spread
from faintrack.likelihoods.heavy_tails import student
from faintrack.likelihoods.unknown_level import UnknownLevel
from faintrack.sensors.cells import Cells, CellScan
from faintrack.signal.background import Whitening, ring_mean
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, rates

CONTRASTS = (None, 3.0, 2.0, 1.0)
"""Of the aircraft; None is the sequence as it is."""
LEVELS, FREEDOM = (2.0, 5.0, 12.0), 10.0
"""Levels of the target, in deviations of the noise; degrees of freedom of its tails."""
WIDTH = 0.55
"""Of the aircraft's spread, pixels: beside its pixel there is a fifth of its level."""
APPEARS, STAYS, WALK = 0.01, 0.98, 0.5
"""Probability of appearing and of staying from frame to frame; how far it walks in one, pixels along each axis."""
MEMORY = 10
"""Frames over which the log odds of existence are averaged before they are compared with the threshold."""
WITHIN, FALSE_SHARE = 3.0, 0.01
"""Pixels from the truth that count as found; share of frames without aircraft in which each method reports one."""


class OnPixels(eqx.Module):
    """Likelihood for a grid whose cells are the pixels: its table, without looking every cell up."""

    likelihood: UnknownLevel

    def log_ratio(self, scan: CellScan, states: PlanarState) -> jax.Array:
        """Log ratio of every pixel."""
        reach = self.likelihood.parts[0].reach
        return self.likelihood.table(scan)[reach:-reach, reach:-reach, None, None]


def tracker(shape: tuple[int, int]) -> tuple[GridFilter, OnPixels]:
    """Filter and likelihood for frames of this shape."""
    pixels, still = [Axis(0.0, 1.0, count) for count in shape], Axis(0.0, 1.0, 1)
    cells = Cells((("y", pixels[0]), ("x", pixels[1])))
    grid = Grid(PlanarState, (*cells.axes, ("vy", still), ("vx", still)))
    spread = gaussian_spread(WIDTH)
    parts = tuple(CellLikelihood(cells, student(FREEDOM), level, spread, reach=1) for level in LEVELS)
    target = Target(None, None, *rates(APPEARS, STAYS, 1.0))
    return GridFilter(grid, target, separable(grid, PlanarMotion(WALK), 1.0)), OnPixels(UnknownLevel(parts))


def keep(belief: Belief) -> tuple[Any, Any, Any]:
    """Log odds and place of the likeliest pixel."""
    best = mode(belief)
    return belief.log_odds, best.x, best.y


@jax.jit
def strongest(residuals: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Highest response of the filter matched to the spread in every frame, and where: level, then (x, y)."""
    shape = residuals.shape[1:]
    cells = Cells((("y", Axis(0.0, 1.0, shape[0])), ("x", Axis(0.0, 1.0, shape[1]))))
    # The log ratio of Gaussian cells rises with the matched filter's output; level 1 leaves its scale.
    matched = CellLikelihood(cells, gaussian, 1.0, gaussian_spread(WIDTH), reach=1)
    response = jax.vmap(lambda values: matched.table(CellScan(0.0, values))[1:-1, 1:-1])(residuals)
    flat = response.reshape(len(residuals), -1)
    place = jnp.argmax(flat, axis=1)
    return jnp.max(flat, axis=1), jnp.stack([place % shape[1], place // shape[1]], axis=1)


def averaged(odds: np.ndarray) -> np.ndarray:
    """Mean of the log odds over the last frames; the first stands for those before it."""
    padded = np.concatenate([np.full(MEMORY - 1, odds[0]), odds])
    return np.lib.stride_tricks.sliding_window_view(padded, MEMORY).mean(axis=1)


def responses(frames: np.ndarray, filter: GridFilter, likelihood: OnPixels) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Statistic to threshold, and place, of every frame by each method."""
    stack = jnp.asarray(frames, jnp.float32)
    residuals, _ = Whitening().whiten(stack)
    scans = CellScan(jnp.arange(len(frames), dtype=jnp.float32), residuals)
    _, (odds, x, y), _ = run(filter, likelihood, scans, jax.random.key(0), keep)
    single, _ = Whitening(memory=0).whiten(stack)
    return {
        "track": (averaged(np.asarray(odds)), np.stack([x, y], axis=1)),
        "frame": tuple(np.asarray(part) for part in strongest(single)),
        "frame, same background": tuple(np.asarray(part) for part in strongest(residuals)),
    }


def painted_over(frames: np.ndarray, truth: np.ndarray, reach: int = 3) -> np.ndarray:
    """Frames with the square around the aircraft replaced, row by row, by a line from its left side to its right."""
    painted = frames.copy()
    along = np.linspace(0, 1, 2 * reach + 3)[1:-1]
    for number, (x, y) in enumerate(truth):
        rows = slice(max(y - reach, 0), y + reach + 1)
        left, right = (frames[number, rows, x + side, None] for side in (-reach - 1, reach + 1))
        painted[number, rows, x - reach : x + reach + 1] = left + along * (right - left)
    return painted


def added_deviation(frames: np.ndarray, truth: np.ndarray, contrast: float | None) -> tuple[float, float]:
    """Deviation of the noise to add for a contrast, and the contrast of the sequence as it is."""
    mean = jax.jit(jax.vmap(lambda values: ring_mean(values, 4, 2)))
    left = frames - mean(jnp.asarray(frames))
    variance = mean(jnp.square(left))
    at = np.arange(len(frames)), truth[:, 1], truth[:, 0]
    signal, own = float(np.median(left[at])), float(np.median(variance[at]))
    return (0.0 if contrast is None else max(signal**2 / contrast**2 - own, 0) ** 0.5), signal / own**0.5


def measures(statistic: np.ndarray, place: np.ndarray, truth: np.ndarray, threshold: float) -> dict[str, Any]:
    """What is reported in one sequence; frames of the first report within reach of the truth, None for never."""
    reported, near = statistic > threshold, np.hypot(*(place - truth).T) <= WITHIN
    false = reported & ~near
    found = np.flatnonzero(reported & near)
    return {
        "share": float(np.mean(reported & near)),
        "declared": int(found[0]) if found.size else None,
        "false_tracks": int(np.sum(np.diff(false.astype(int), prepend=0) > 0)),
        "false_frames": int(false.sum()),
    }


def main() -> None:
    """Measure every sequence at every contrast."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--draws", type=int, default=5, help="of the noise, for the thresholds and for the test each")
    options = parser.parse_args()
    files = sorted(options.folder.glob("sequence*.npz"))
    if not files:
        parser.exit(0, f"{options.folder}: no sequences; nothing is measured.\n")
    rows = []
    for file in files:
        data = np.load(file)
        frames, truth = data["frames"].astype(np.float32), data["truth_xy"].astype(int)
        filter, likelihood = tracker(frames.shape[1:])
        painted = painted_over(frames, truth)
        for contrast in CONTRASTS:
            deviation, own = added_deviation(frames, truth, contrast)
            draws = options.draws if deviation else 1

            def noisy(clean: np.ndarray, seed: int, deviation: float = deviation) -> np.ndarray:
                return clean + deviation * np.random.default_rng(seed).normal(size=clean.shape).astype(np.float32)

            without = [responses(noisy(painted, 1000 + draw), filter, likelihood) for draw in range(draws)]
            found = [responses(noisy(frames, draw), filter, likelihood) for draw in range(draws)]
            for method in found[0]:
                noise = np.concatenate([result[method][0] for result in without])
                threshold = float(np.sort(noise)[-1 - round(FALSE_SHARE * noise.size)])
                each = [measures(*result[method], truth, threshold) for result in found]
                row = {"sequence": file.stem, "contrast": contrast, "own_contrast": own, "added": deviation}
                rows.append(row | {"method": method, "threshold": threshold, "draws": each})
                print(file.stem, contrast, method, f"{threshold:.1f}", each, flush=True)
    settings = {"within": WITHIN, "false_share": FALSE_SHARE, "frames": len(frames), "draws": options.draws}
    options.out.write_text(json.dumps(settings | {"rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
