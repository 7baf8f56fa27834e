"""How dim an aircraft may be: track before detect against the best single frame, on real infrared sequences.

Five sequences of 100 frames, as they are and with white noise added until the contrast of the aircraft, its residual
over the local noise at the true pixel (median over the frames), is 3, 2 and 1. Both methods have the threshold that one
frame in a hundred passes in the same sequence with the aircraft painted over, under other draws of the noise.

Each sequence is tracked with the settings of `SETTINGS` under which most frames of the other four are found, as they
are and at contrast 3: it takes no part in the choice. Writes the numbers that `plot_dim_aircraft.py` draws:

    python examples/dim_aircraft.py ../shared/data/ir_dim_aircraft --out docs/validation_data/dim_aircraft.json
"""

import argparse
import dataclasses
import itertools
import json
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief, mode
from faintrack.beliefs.grids import Grid
from faintrack.filters.grid import GridFilter
from faintrack.filters.run import run
from faintrack.filters.separable import separable
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
WIDTH = 0.55
"""Of the aircraft's spread, pixels: beside its pixel there is a fifth of its level."""
APPEARS, STAYS, WALK = 0.01, 0.98, 0.5
"""Probability of appearing and of staying from frame to frame; how far it walks in one, pixels along each axis."""
WITHIN, FALSE_SHARE = 3.0, 0.01
"""Pixels from the truth that count as found; share of frames without aircraft in which each method reports one."""
CHOOSE = (None, 3.0)
"""Contrasts on which the settings are chosen."""


@dataclasses.dataclass(frozen=True)
class Settings:
    """What the scene does not tell beforehand.

    Attributes
    ----------
    levels : of the target, equally probable, in deviations of the noise.
    freedom : degrees of freedom of the noise's tails; many, and it is normal.
    memory : frames over which the log odds of existence are averaged before they are compared with the threshold.
    """

    levels: tuple[float, ...]
    freedom: float
    memory: int


FILTERS = tuple(itertools.product(((2.0, 5.0, 12.0), (5.0,)), (10.0, 1000.0)))
MEMORIES = (1, 10, 20)
SETTINGS = tuple(Settings(*each, memory) for each in FILTERS for memory in MEMORIES)
"""To choose from."""


Responses = dict[Any, tuple[np.ndarray, np.ndarray]]
"""Statistic to threshold, and place, of every frame by each method; trackers by their settings."""


class OnPixels(eqx.Module):
    """Likelihood for a grid whose cells are the pixels: its table, without looking every cell up."""

    likelihood: UnknownLevel

    def log_mean_ratio(self, scan: CellScan) -> jax.Array:
        """Log ratio of every pixel."""
        reach = self.likelihood.parts[0].reach
        return self.likelihood.table(scan)[reach:-reach, reach:-reach, None, None]


def tracker(shape: tuple[int, int], levels: tuple[float, ...], freedom: float) -> tuple[GridFilter, OnPixels]:
    """Filter and likelihood for frames of this shape; the rest as in `Settings`."""
    pixels, still = [Axis(0.0, 1.0, count) for count in shape], Axis(0.0, 1.0, 1)
    cells = Cells((("y", pixels[0]), ("x", pixels[1])))
    grid = Grid(PlanarState, (*cells.axes, ("vy", still), ("vx", still)))
    spread = gaussian_spread(WIDTH)
    parts = tuple(CellLikelihood(cells, student(freedom), level, spread, reach=1) for level in levels)
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


def averaged(odds: np.ndarray, memory: int) -> np.ndarray:
    """Mean of the log odds over the last frames; the first stands for those before it."""
    padded = np.concatenate([np.full(memory - 1, odds[0]), odds])
    return np.lib.stride_tricks.sliding_window_view(padded, memory).mean(axis=1)


def tracked(residuals: jax.Array) -> Responses:
    """By the tracker under each of the settings."""
    scans = CellScan(jnp.arange(len(residuals), dtype=jnp.float32), residuals)
    found = {}
    for levels, freedom in FILTERS:
        filter, likelihood = tracker(residuals.shape[1:], levels, freedom)
        _, (odds, x, y), _ = run(filter, likelihood, scans, jax.random.key(0), keep)
        for memory in MEMORIES:
            averages = averaged(np.asarray(odds), memory)
            found[Settings(levels, freedom, memory)] = averages, np.stack([x, y], axis=1)
    return found


def responses(frames: np.ndarray) -> Responses:
    """By every tracker, and by the strongest pixel of the frame under both backgrounds."""
    stack = jnp.asarray(frames, jnp.float32)
    residuals, single = (whitening.whiten(stack)[0] for whitening in (Whitening(), Whitening(memory=0)))
    return tracked(residuals) | {
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


def measured(frames: np.ndarray, truth: np.ndarray, contrast: float | None, draws: int) -> dict[Any, dict[str, Any]]:
    """Threshold and measures of every draw of the noise by each method; one draw where no noise is added."""
    deviation, _ = added_deviation(frames, truth, contrast)

    def noisy(clean: np.ndarray, first: int) -> list[Responses]:
        seeds = range(first, first + (draws if deviation else 1))
        drawn = (np.random.default_rng(seed).normal(size=clean.shape).astype(np.float32) for seed in seeds)
        return [responses(clean + deviation * each) for each in drawn]

    without, found = noisy(painted_over(frames, truth), 1000), noisy(frames, 0)
    result = {}
    for method in found[0]:
        noise = np.concatenate([response[method][0] for response in without])
        threshold = float(np.sort(noise)[-1 - round(FALSE_SHARE * noise.size)])
        each = [measures(*response[method], truth, threshold) for response in found]
        result[method] = {"threshold": threshold, "draws": each}
    return result


def share(row: dict[str, Any]) -> float:
    """Of frames found, mean over the draws."""
    return float(np.mean([draw["share"] for draw in row["draws"]]))


def main() -> None:
    """Measure every sequence at every contrast under all settings; then choose those of each on the others."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--draws", type=int, default=4, help="of the noise, for the thresholds and for the test each")
    options = parser.parse_args()
    files = sorted(options.folder.glob("sequence*.npz"))
    if not files:
        parser.exit(0, f"{options.folder}: no sequences; nothing is measured.\n")
    found, about = {}, {}
    for file in files:
        data = np.load(file)
        frames, truth = data["frames"].astype(np.float32), data["truth_xy"].astype(int)
        for contrast in CONTRASTS:
            found[file.stem, contrast] = measured(frames, truth, contrast, options.draws)
            added, own = added_deviation(frames, truth, contrast)
            about[file.stem, contrast] = {"own_contrast": own, "added": added}
            print(
                file.stem, contrast, [round(share(row), 2) for row in found[file.stem, contrast].values()], flush=True
            )

    rows, chosen = [], {}
    for name in (file.stem for file in files):

        def elsewhere(settings: Settings, name: str = name) -> float:
            return sum(share(found[key][settings]) for key in found if key[0] != name and key[1] in CHOOSE)

        chosen[name] = max(SETTINGS, key=elsewhere)
        print(name, chosen[name], flush=True)
        for contrast in CONTRASTS:
            each = found[name, contrast]
            for method, key in (("track", chosen[name]), *((key, key) for key in each if isinstance(key, str))):
                row = {"sequence": name, "contrast": contrast} | about[name, contrast]
                rows.append(row | {"method": method} | each[key])
    shares = [
        dataclasses.asdict(settings)
        | {
            "shares": {
                f"{name} {contrast or 'as it is'}": share(each[settings]) for (name, contrast), each in found.items()
            }
        }
        for settings in SETTINGS
    ]
    result = {"within": WITHIN, "false_share": FALSE_SHARE, "draws": options.draws, "settings": shares}
    result["chosen"] = {name: dataclasses.asdict(settings) for name, settings in chosen.items()}
    options.out.write_text(json.dumps(result | {"rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
