"""Ships that move among fixed echoes: 18 scans of a navigation radar, the whole picture.

A ship shows as a blob as large as a fixed echo, and moves by less than its own width while it is watched. So a fixed
echo is a hypothesis like the ship: over position and velocity, half of the prior belongs to standing still. The state
is the place in the middle of the watch and the velocity, x in samples along the range and y in spokes; it does not
change, and every scan is looked up where the straight line is at its time. Declared is what likelier moves than stands
still or is not there, by a threshold that the same scans in shuffled order do not pass: they hold the same echoes with
the same fluctuations, and nothing that moves. Writes the numbers that `plot_marine_radar.py` draws:

    python examples/marine_radar.py ../shared/data/marine_radar --out docs/validation_data/marine_radar.json
"""

import argparse
import dataclasses
import json
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief, mean, update
from faintrack.beliefs.grids import Grid
from faintrack.likelihoods.cells import CellLikelihood, gaussian
from faintrack.likelihoods.unknown_level import UnknownLevel
from faintrack.sensors.cells import Cells, CellScan
from faintrack.targets.states import PlanarState

FILE = "navico_halo_lauwersoog_38km.npz"
SPOKES = 4
"""Spokes that are averaged into a cell; a beam is about 18 wide."""
DEVIATION, LEVELS = 15.0, (5.0, 15.0)
"""Of the noise of a cell, and levels of a target, of 15. So large a deviation because the 100 cells of a blob rise and
fall together: between them they tell no more than a few."""
WIDTHS, REACH = (2.0, 4.0), 7
"""Of a blob: standard deviations along spokes and range, cells; how far it is looked at."""
SPEEDS = Axis(-0.6, 0.1, 13)
"""Along the range, samples a scan: 7.5 m/s either way."""
TURNS = Axis(-2.0, 1.0, 5)
"""Across, spokes a scan."""
WINDOW = (32, 16)
"""Spokes and samples of a window; each has its own belief in one target whose middle lies there."""
MARGIN = (16, 8)
"""Around it, in which an echo may stand that a target in the window only seems to pass; spokes and samples."""
SHUFFLES = 9


def spread(across: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Share of the level in cells around the target."""
    return np.exp(-((across / WIDTHS[0]) ** 2 + (along / WIDTHS[1]) ** 2) / 2)


def sensor(shape: tuple[int, int]) -> UnknownLevel:
    """Likelihood for scans of this many averaged spokes and samples."""
    cells = Cells((("y", Axis((SPOKES - 1) / 2, SPOKES, shape[0])), ("x", Axis(0.0, 1.0, shape[1]))))
    return UnknownLevel(tuple(CellLikelihood(cells, gaussian, level / DEVIATION, spread, REACH) for level in LEVELS))


def read(file: Path) -> CellScan:
    """Scans over the deviation of the noise; time in scans from the middle of the watch."""
    intensity = np.load(file)["intensity"].astype(np.float32)
    count, _, samples = intensity.shape
    averaged = intensity.reshape(count, -1, SPOKES, samples).mean(axis=2)
    return CellScan(jnp.arange(count) - (count - 1) / 2, jnp.asarray(averaged / DEVIATION))


def start(y: jax.Array, x: jax.Array) -> Belief:
    """Belief in a window before any scan: half still there or around it, half moving there at the other velocities."""
    rows, columns = (size + 2 * margin for size, margin in zip(WINDOW, MARGIN, strict=True))
    axes = (
        ("y", Axis(1.0 - MARGIN[0], 2.0, rows // 2)),
        ("x", Axis(-float(MARGIN[1]), 1.0, columns)),
        ("vy", TURNS),
        ("vx", SPEEDS),
    )
    grid = Grid(PlanarState, axes)
    states = grid.states()
    within = (states.x >= 0) & (states.x < WINDOW[1]) & (states.y >= 0) & (states.y < WINDOW[0])
    stands = jnp.broadcast_to(still(states), grid.shape)
    moves = within & ~stands
    share = jnp.where(stands, 0.5 / jnp.sum(stands), 0.0) + jnp.where(moves, 0.5 / jnp.sum(moves), 0.0)
    states = dataclasses.replace(states, x=states.x + x, y=states.y + y)
    return Belief(states, jnp.log(share), jnp.zeros(()), jnp.zeros(()))


def still(states: PlanarState) -> jax.Array:
    """Which states do not move."""
    return (jnp.abs(states.vx) < SPEEDS.step / 2) & (jnp.abs(states.vy) < TURNS.step / 2)


@eqx.filter_jit
def tables(likelihood: UnknownLevel, scans: CellScan) -> jax.Array:
    """Log ratio at every place of every scan."""
    return jax.lax.map(likelihood.table, scans)


@eqx.filter_jit
def moving(
    likelihood: UnknownLevel, tabled: jax.Array, time: jax.Array, corners: jax.Array
) -> tuple[jax.Array, PlanarState]:
    """For every window the log odds of a target that moves against a still one or none, and its mean state.

    Parameters
    ----------
    likelihood, tabled : the sensor, and its log ratio at every place of every scan.
    time : of the scans, from the middle; scans.
    corners : spoke and sample of the first corner of every window, shape (window, 2).
    """
    places = likelihood.parts[0].places

    def watch(corner: jax.Array) -> tuple[jax.Array, PlanarState]:
        def take(belief: Belief, scan: tuple[jax.Array, jax.Array]) -> tuple[Belief, None]:
            at, table = scan
            s = belief.states
            place, inside = places.nearest(dataclasses.replace(s, x=s.x + at * s.vx, y=s.y + at * s.vy))
            return update(belief, jnp.where(inside, table[place], 0))[0], None

        belief, _ = jax.lax.scan(take, start(*corner), (time, tabled))
        joint = belief.log_odds + belief.log_weights
        stands = jnp.broadcast_to(still(belief.states), joint.shape)
        moves = jax.nn.logsumexp(jnp.where(stands, -jnp.inf, joint))
        against = jnp.logaddexp(0.0, jax.nn.logsumexp(jnp.where(stands, joint, -jnp.inf)))
        return moves - against, mean(belief, jnp.where(stands, 0, jnp.exp(joint - moves)))

    return jax.lax.map(watch, corners)


def windows(tabled: jax.Array, shape: tuple[int, int]) -> jax.Array:
    """Corners of the windows in which a target is likelier than none, at rest and at the best place, in some scan."""
    spokes, samples = shape[0] * SPOKES, shape[1]
    best = np.asarray(jnp.max(tabled, axis=0))[REACH:-REACH, REACH:-REACH]
    blocks = best.reshape(spokes // WINDOW[0], WINDOW[0] // SPOKES, samples // WINDOW[1], WINDOW[1])
    return jnp.asarray(np.argwhere(blocks.max(axis=(1, 3)) > 0) * np.array(WINDOW), jnp.float32)


def separate(odds: np.ndarray, states: np.ndarray, threshold: float) -> list[dict[str, float]]:
    """What is declared, the likeliest first; what lies within a blob of a likelier one is the same."""
    found: list[dict[str, float]] = []
    for number in np.argsort(-odds):
        y, x, vy, vx = states[number].tolist()
        same = any(abs(each["spoke"] - y) < 24 and abs(each["sample"] - x) < 12 for each in found)
        if odds[number] > threshold and not same:
            rates = {"samples_a_scan": vx, "spokes_a_scan": vy}
            found.append({"log_odds": float(odds[number]), "spoke": y, "sample": x} | rates)
    return found


def watched(likelihood: UnknownLevel, tabled: jax.Array, time: jax.Array, corners: jax.Array) -> Any:
    """`moving`, as arrays; states in the order y, x, vy, vx."""
    odds, states = moving(likelihood, tabled, time, corners)
    return np.asarray(odds), np.stack([states.y, states.x, states.vy, states.vx], axis=1)


def main() -> None:
    """Find what moves."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    if not (options.folder / FILE).exists():
        parser.exit(0, f"{options.folder / FILE}: no recording; nothing is measured.\n")
    scans = read(options.folder / FILE)
    likelihood = sensor(scans.values.shape[1:])
    tabled = tables(likelihood, scans)
    corners = windows(tabled, scans.values.shape[1:])
    print(len(corners), "windows", flush=True)
    rng, shuffled = np.random.default_rng(0), []
    for _ in range(SHUFFLES):
        odds, states = watched(likelihood, tabled, scans.time[rng.permutation(len(scans.time))], corners)
        shuffled.append(float(odds.max()))
        print("shuffled", np.sort(odds)[-5:], states[odds.argmax()], flush=True)
    odds, states = watched(likelihood, tabled, scans.time, corners)
    threshold = max(shuffled)
    found = separate(odds, states, threshold)
    for each in found:
        print({name: round(value, 2) for name, value in each.items()})
    result = {"windows": len(corners), "shuffled": shuffled, "threshold": threshold, "found": found}
    options.out.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
