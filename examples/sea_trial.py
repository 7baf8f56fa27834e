"""From the samples of 250 hydrophones to tracks: two ships that cross in bearing, and one that is outside the region.

The geometry of kreucher2011, section VII-B: two straight segments of 125 hydrophones, 200 m long, sampled at 1000 Hz;
2 x 2 detectors of 51 x 13 x 51 x 13 cells of 50 m and 2 m/s. Its recordings are not public. Ships move here as two did
in the Solent (AIS reports), turned and scaled to the region. Their noise is drawn sample by sample, 27 dB below that of
a hydrophone, beamformed by our own beamformer, integrated over frequency, and standardised by median and deviation of
the beams. The surroundings of the region are watched too, as far as the ship outside is. Every run draws noise and
particles anew. Writes figures 8 to 15 of the first and the numbers of all:

    python examples/sea_trial.py SolentAIS_20160112_130211.csv --runs 20 --out docs/validation_data
"""

import argparse
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Ellipse, Rectangle
from scipy.signal import savgol_filter

from faintrack.beliefs.axis import between
from faintrack.errors import InputError
from faintrack.io.ais import read_ships
from faintrack.likelihoods.beam_energies import ELSEWHERE, BeamEnergies
from faintrack.metrics.intervals import bootstrap_interval
from faintrack.metrics.sets import gospa
from faintrack.sensors.array import line_array
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.signal.beamformer import beamformer
from faintrack.signal.energies import energies, standardised
from faintrack.simulation.samples import Source, draw_samples
from faintrack.targets.states import PlanarState
from faintrack.trackers.several import SeveralEstimate, SeveralTargetsTracker, region_tracker

SECONDS, RATE, BAND = 400, 1000.0, (300.0, 450.0)
HYDROPHONES, SPACING = 125, 200 / 124
STATIONS_X, HEADING_DEG = (0.0, 1200.0), (89.4, 90.6)
SNR_DB = -27.0
REGION = (-1500.0, 2700.0), (800.0, 4600.0)
SHIPS = (("235031617", (-800.0, 1500.0), (500.0, 2300.0)), ("235013375", (1500.0, 1700.0), (100.0, 2500.0)))
"""Which ship of the AIS reports, and from where to where it is made to go; m."""
OUTSIDE = (1500.0, 9000.0), (200.0, 9200.0)
"""From where to where the ship outside goes; m."""
LEVEL, SPREAD = 3.0, 1.3
"""Mean and standard deviation of the energy of a beam with a ship; a ship between two beams is in neither in full."""
BEAMS = 181
CUTOFF = 200.0
"""Distance from a ship beyond which a track is not at it, m: two deviations of where two beams cross."""
SETTLED = 60
"""Scans after which ships should be held."""
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


@dataclass(frozen=True)
class Ship(Source):
    """A source whose bearing follows a path."""

    path: tuple[float, ...] = ()

    def bearing_at(self, time: np.ndarray | float) -> np.ndarray:
        """Bearing at given times, between those of whole seconds."""
        return np.interp(time, np.arange(len(self.path)), self.path)


def ais_paths(file: Path) -> list[np.ndarray]:
    """Places of the ships at whole seconds, shape (second, 2); smoothed, as reports are rounded."""
    ships = {ship.name: ship for ship in read_ships(file)}
    found = []
    for name, start, end in SHIPS:
        if name not in ships:
            raise InputError(
                f"{file}: there is no report of the ship {name}; expected those of both that are followed."
            )
        ship = ships[name]
        north, east = np.radians(ship.places.T)
        second = ship.times[0] + np.arange(SECONDS + 1)
        track = np.stack([np.interp(second, ship.times, part) for part in (east * np.cos(np.radians(50.8)), north)])
        # Parabolas of 41 s, at the ends too: a ship does not begin by standing still.
        place = np.array([1, 1j]) @ savgol_filter(track, 41, 2)
        # Turned, scaled and moved, so that it goes from start to end.
        turned = (place - place[0]) / (place[-1] - place[0]) * (complex(*end) - complex(*start)) + complex(*start)
        found.append(np.stack([turned.real, turned.imag], axis=1))
    return found


def records(paths: list[np.ndarray], fans: Fans, stations: Stations, run: int) -> np.ndarray:
    """Energies of the beams of both arrays, second by second, from samples."""
    array = line_array(HYDROPHONES, SPACING)
    plan = beamformer(array, RATE, frame=1.0, band=BAND, beams=BEAMS)
    scan = eqx.filter_jit(lambda samples: energies(plan.scan(jnp.zeros(1), samples, jnp.ones((1, HYDROPHONES), bool))))
    heard = []
    for path in paths:
        still = jnp.zeros(len(path))
        heard.append(np.asarray(fans.bearings(stations, PlanarState(*jnp.asarray(path, jnp.float32).T, still, still))))
    rows: list[list[np.ndarray]] = []
    for number in range(len(STATIONS_X)):
        ships = [Ship(SNR_DB, float(each[number, 0]), path=tuple(each[number].tolist())) for each in heard]
        waiting, mine = np.zeros((0, HYDROPHONES), np.float32), []
        for block in draw_samples(array, ships, SECONDS, RATE, seed=1000 * run + number):
            waiting = np.concatenate([waiting, block])
            while len(waiting) >= RATE:
                mine.append(np.asarray(standardised(scan(jnp.asarray(waiting[None, : int(RATE)]))[0])))
                waiting = waiting[int(RATE) :]
        rows.append(mine)
    return np.moveaxis(np.array(rows), 0, 1)


def plan_tracker(fans: Fans, surroundings: float) -> SeveralTargetsTracker:
    """The paper's detectors and, around the region, one more; with trackers of eight ships."""
    return region_tracker(
        BeamEnergies(fans, present_mean=LEVEL, present_std=SPREAD, elsewhere=ELSEWHERE),
        *REGION,
        detectors=(2, 2),
        cells=(51, 51),
        cell=50.0,
        speed=between(-13.0, 13.0, 13),
        # One ship stops from 5 m/s within 40 s.
        velocity_noise=0.3,
        interval=1.0,
        arrival_rate=1e-4,
        departure_rate=1e-3,
        surroundings=surroundings,
        declare=0.999,
        hold=25,
    )


def main() -> None:
    """Simulate, track, draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("reports", type=Path, help="AIS reports")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--surroundings", type=float, default=6000.0, help="that are watched, m; 0 for none")
    parser.add_argument("--keep", type=Path, help="folder where energies are kept between calls")
    options = parser.parse_args()
    step = float(np.pi / (BEAMS - 1))
    fans = Fans((0.0, 0.0), (step, step), (BEAMS, BEAMS), (True, True))
    stations = Stations(jnp.array(STATIONS_X), jnp.zeros(2), jnp.radians(jnp.array(HEADING_DEG)))
    try:
        inside = ais_paths(options.reports)
    except InputError as error:
        raise SystemExit(str(error)) from None
    outside = np.linspace(*OUTSIDE, SECONDS + 1)
    time = np.arange(SECONDS) + 0.5
    truth = np.array([np.stack([np.interp(time, np.arange(len(path)), each) for each in path.T], 1) for path in inside])
    everywhere = jax.tree.map(lambda values: jnp.broadcast_to(values, (SECONDS, 2)), stations)
    tracker = plan_tracker(fans, options.surroundings)
    options.out.mkdir(parents=True, exist_ok=True)
    runs = []
    for run in range(options.runs):
        energy = kept(options.keep, run, lambda run=run: records([*inside, outside], fans, stations, run))
        usable = jnp.ones(energy.shape, bool)
        scans = EnergyScan(jnp.asarray(time, jnp.float32), jnp.asarray(energy, jnp.float32), usable, everywhere)
        for_start, for_scans = (jax.random.key(2 * run + number) for number in range(2))
        _, estimate = tracker.steps(tracker.init(for_start), scans, for_scans)
        found = jax.tree.map(np.asarray, estimate)
        runs.append(summary(found, truth))
        print(f"run {run + 1}: {json.dumps(runs[-1])}", flush=True)
        if run == 0:
            draw(options.out, found, truth, outside, energy, fans, stations, tracker)
            scene = describe(truth, energy, fans, stations)
    numbers = {"surroundings_m": options.surroundings, **scene, **together(runs), "runs": runs}
    (options.out / "kreucher2011_sea.json").write_text(json.dumps(numbers, indent=1) + "\n")
    print(json.dumps({name: value for name, value in numbers.items() if name != "runs"}, indent=1))


def kept(folder: Path | None, run: int, simulate: Callable[[], np.ndarray]) -> np.ndarray:
    """Energies of a run, from a folder if they are there already."""
    if folder is None:
        return simulate()
    file = folder / f"{run}.npy"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        np.save(file, simulate())
    return np.load(file)


def summary(found: SeveralEstimate, truth: np.ndarray) -> dict[str, Any]:
    """Tracks of a run and how well they follow the ships."""
    place = np.stack([found.mean.x, found.mean.y], axis=-1)
    declared = found.label > 0
    apart = np.linalg.norm(place[None] - truth[:, :, None], axis=-1)
    at = declared & (apart < CUTOFF)
    tracks = []
    for label in range(1, int(found.label.max(initial=0)) + 1):
        scan, slot = np.nonzero(found.label == label)
        mine = apart[:, scan, slot]
        ship = int(np.median(mine, axis=1).argmin())
        tracks.append(
            {
                "scans": [int(scan[0]) + 1, int(scan[-1]) + 1],
                "ship": ship + 1 if np.median(mine[ship]) < CUTOFF else None,
                "rmse_m": round(float(np.sqrt(np.mean(mine[ship] ** 2))), 1),
            }
        )
    # Of the tracks at a ship, the nearest.
    nearest = np.where(at.any(axis=2), np.where(at, apart, np.inf).min(axis=2), np.nan)
    distance = [gospa(place[t][declared[t]], truth[:, t], CUTOFF).total for t in range(SETTLED, SECONDS)]
    return {
        "false_tracks": sum(track["ship"] is None for track in tracks),
        "false_s": int((declared & ~at.any(axis=0)).sum()),
        "held": [round(float(np.isfinite(one[SETTLED:]).mean()), 3) for one in nearest],
        "rmse_m": [round(float(np.sqrt(np.nanmean(one**2))), 1) if np.isfinite(one).any() else None for one in nearest],
        "gospa_m": round(float(np.mean(distance)), 1),
        "joint_scans": int((found.joint & declared).any(axis=1).sum()),
        "tracks": tracks,
    }


def together(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Means over runs with 95 % intervals, of runs drawn anew."""

    def mean(values: Iterable[Any]) -> list[float]:
        numbers = np.array([value for value in values if value is not None], float)
        low, high = bootstrap_interval(np.mean, numbers)
        return [round(float(value), 3) for value in (numbers.mean(), low, high)]

    return {
        "false_tracks_mean": mean(run["false_tracks"] for run in runs),
        "false_s_mean": mean(run["false_s"] for run in runs),
        **{f"held_ship_{ship + 1}": mean(run["held"][ship] for run in runs) for ship in range(2)},
        **{f"rmse_m_ship_{ship + 1}": mean(run["rmse_m"][ship] for run in runs) for ship in range(2)},
        "gospa_m_mean": mean(run["gospa_m"] for run in runs),
    }


def describe(truth: np.ndarray, energy: np.ndarray, fans: Fans, stations: Stations) -> dict[str, Any]:
    """When the ships share a beam, and how loud their beams are."""
    still = np.zeros(truth.shape[1])
    at = np.stack([np.asarray(fans.beams(stations, PlanarState(*path.T, still, still))) for path in truth])
    level = [np.take_along_axis(energy, beams.T[..., None], axis=2).mean() for beams in at]
    close = [np.flatnonzero(np.abs(at[0, number] - at[1, number]) <= 1) + 1 for number in range(2)]
    return {
        "ships_within_a_beam": {
            f"segment_{number + 1}": [int(when[0]), int(when[-1])] for number, when in enumerate(close) if len(when)
        },
        "mean_level_of_the_ships_beams": [round(float(value), 2) for value in level],
    }


def draw(
    out: Path,
    found: SeveralEstimate,
    truth: np.ndarray,
    outside: np.ndarray,
    energy: np.ndarray,
    fans: Fans,
    stations: Stations,
    tracker: SeveralTargetsTracker,
) -> None:
    """Figures 8 to 15."""

    def bearing(path: np.ndarray) -> np.ndarray:
        still = np.zeros(path.shape[:-1])
        return np.degrees(fans.bearings(stations, PlanarState(path[..., 0], path[..., 1], still, still)))

    place = np.stack([found.mean.x, found.mean.y], axis=-1)
    labelled = [(label, *np.nonzero(found.label == label)) for label in range(1, int(found.label.max(initial=0)) + 1)]
    colours = {label: COLOURS[(label - 1) % len(COLOURS)] for label, _, _ in labelled}

    figure, axes = plt.subplots(2, 3, figsize=(12, 8), sharex=True, sharey=True, layout="constrained")
    for number, row in enumerate(axes):
        for axis, title in zip(row, ("8: record", "10: where the ships are", "15: tracks"), strict=True):
            picture = axis.imshow(
                energy[:, number],
                aspect="auto",
                origin="lower",
                cmap="Greys",
                vmin=-1,
                vmax=5,
                extent=(-0.5, BEAMS - 0.5, 0, SECONDS),
                interpolation="nearest",
            )
            axis.set_title(f"{title}, segment {number + 1}", fontsize=10)
        for path in truth:
            row[1].plot(bearing(path)[number], np.arange(SECONDS) + 0.5, color="#0072B2", linewidth=1)
        row[1].plot(bearing(outside)[number], np.arange(SECONDS + 1), "--", color="#D55E00", linewidth=1)
        for label, scan, slot in labelled:
            row[2].plot(bearing(place[scan, slot])[number], scan + 0.5, color=colours[label], linewidth=1.2)
        row[0].set_ylabel("time (s)")
    for axis in axes[1]:
        axis.set_xlabel("bearing from the segment's axis (degrees)")
    axes[0, 0].set_xlim(20, 150)
    figure.colorbar(picture, ax=axes, shrink=0.5).set_label("energy of a beam (deviations of the noise)")
    figure.savefig(out / "kreucher2011_8_10_15.png", dpi=80)
    plt.close(figure)

    figure, axes = plt.subplots(2, 2, figsize=(11, 10), sharex=True, sharey=True, layout="constrained")
    titles = ("9: region and detectors", "11: middles of the true beams, intersected", "12: tracks", "14: one track")
    for axis, title in zip(axes.ravel(), titles, strict=True):
        axis.plot(STATIONS_X, (0, 0), "s", color="#777777")
        for number, x in enumerate(STATIONS_X):
            axis.annotate(f"segment {number + 1}", (x, 0), xytext=(0, 8), textcoords="offset points", fontsize=8)
        for path in truth:
            axis.plot(*path.T, "--", color="#777777", linewidth=1)
        axis.set_title(title, fontsize=10)
        axis.set_aspect("equal")
        axis.grid(alpha=0.3)
    detectors = tracker.detectors.place
    for x, y in zip(np.asarray(detectors.x), np.asarray(detectors.y), strict=True):
        axes[0, 0].add_patch(Rectangle((x, y), 2550, 2550, fill=False, color="#0072B2"))
    for number, path in enumerate(truth):
        middles = np.radians(np.round(bearing(path)))
        east = np.radians(90 - np.array(HEADING_DEG))[:, None] + middles
        slope = np.tan(east)
        x = (STATIONS_X[0] * slope[0] - STATIONS_X[1] * slope[1]) / (slope[0] - slope[1])
        axes[0, 1].plot(x, slope[0] * (x - STATIONS_X[0]), color=COLOURS[number], linewidth=0.8)
    for label, scan, slot in labelled:
        axes[1, 0].plot(*place[scan, slot].T, color=colours[label], linewidth=1.2)
    if labelled:
        label, scan, slot = max(labelled, key=lambda each: len(each[1]))
        axes[1, 1].plot(*place[scan, slot].T, color=colours[label], linewidth=1.2)
        for t, s in list(zip(scan, slot, strict=True))[::16]:
            values, vectors = np.linalg.eigh(found.covariance[t, s][:2, :2])
            turn = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
            wide, narrow = 4 * np.sqrt(np.maximum(values[::-1], 0))
            axes[1, 1].add_patch(Ellipse(place[t, s], wide, narrow, angle=turn, fill=False, color="black", lw=0.8))
    for axis in axes[1]:
        axis.set_xlabel("east (m)")
    for axis in axes[:, 0]:
        axis.set_ylabel("north (m)")
    figure.savefig(out / "kreucher2011_9_11_12_14.png", dpi=80)
    plt.close(figure)

    figure, axis = plt.subplots(figsize=(8, 3.2), layout="constrained")
    for number, values in enumerate(found.detection.T):
        axis.plot(np.arange(SECONDS) + 0.5, values, color=COLOURS[number], linewidth=1, label=f"detector {number + 1}")
    axis.axhline(tracker.detect, color="#777777", linestyle="--", linewidth=0.8)
    axis.set(xlabel="time (s)", ylabel="target-present probability", ylim=(0, 1.05), title="13: detection statistics")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
    figure.savefig(out / "kreucher2011_13.png", dpi=80)
    plt.close(figure)


if __name__ == "__main__":
    main()
