"""How far the lobe-width likelihood's false tracks hang on what is chosen (bosser2022, table II).

Runs on noise, 180 scans each, as the study bosser2022 has them, with one thing changed at a time: the threshold on
existence that one run in a hundred passes. And the mean of the ratio under noise, which is 1 for a ratio of densities:

    python examples/lobe_width_thresholds.py --out docs/validation_data/lobe_width.json
"""

import argparse
import dataclasses
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import expit

from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import run
from faintrack.likelihoods.lobe_width import LobeWidth, lobe_width_likelihood
from faintrack.metrics.intervals import quantile_interval
from faintrack.sensors.beams import BeamScan
from faintrack.simulation.spectra import draw_spectra
from faintrack.studies.bosser2022.scene import LOBE, NOISE_SCANS, make_filter, scene

BATCH, SHARE = 32, 0.01


def silence(key: jax.Array, scans: int) -> BeamScan:
    """Scans of noise alone."""
    at = scene()
    spectra = draw_spectra(key, at.array, at.plan.grid, jnp.ones(scans), jnp.full(scans, -jnp.inf))
    return jax.vmap(at.plan.scan_frame)(jnp.arange(1.0, scans + 1), spectra)


def highest(filter: BernoulliParticleFilter, likelihood: LobeWidth, runs: int) -> np.ndarray:
    """Highest log odds of each run."""

    def one(number: jax.Array) -> jax.Array:
        for_noise, for_filter = jax.random.split(jax.random.fold_in(jax.random.key(0), number))
        scans = silence(for_noise, NOISE_SCANS)
        return run(filter, likelihood, scans, for_filter, lambda belief: belief.log_odds)[1].max()

    batch = jax.jit(lambda first: jax.vmap(one)(first + jnp.arange(BATCH)))
    return np.concatenate([batch(first) for first in range(0, runs, BATCH)])[:runs]


def main() -> None:
    """Change one thing at a time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--runs", type=int, default=2048, help="of each variant")
    options = parser.parse_args()
    grid = scene().plan.grid
    known = lobe_width_likelihood(grid, LOBE)
    filter = make_filter()
    variants = {
        "as in the study": (filter, known),
        "exponent 4": (filter, dataclasses.replace(known, exponent=4.0)),
        "exponent 6": (filter, dataclasses.replace(known, exponent=6.0)),
        "half the lobe": (filter, lobe_width_likelihood(grid, LOBE / 2)),
        "twice the lobe": (filter, lobe_width_likelihood(grid, LOBE * 2)),
        "300 particles": (make_filter(300, 75), known),
        "4000 particles": (make_filter(4000, 1000), known),
    }
    told = {}
    for name, (each, likelihood) in variants.items():
        odds = highest(each, likelihood, options.runs)
        ends = quantile_interval(odds, 1 - SHARE)
        told[name] = {
            "threshold": float(expit(np.quantile(odds, 1 - SHARE))),
            "interval": [float(expit(x)) for x in ends],
        }
        print(name, told[name], flush=True)
    table = jax.jit(
        lambda key: jnp.exp(jax.vmap(lambda scan: known.table(scan, jnp.zeros(1)))(silence(key, 250))).mean(0)
    )
    means = np.mean([table(key)[:, 0] for key in jax.random.split(jax.random.key(1), 60)], axis=0)
    mean = {"all": means.mean(), "60 to 120 degrees": means[60:120].mean(), "below 10 degrees": means[:10].mean()}
    kept = {
        "runs": options.runs,
        "share": SHARE,
        "thresholds": told,
        "mean_ratio_under_noise": {k: float(v) for k, v in mean.items()},
    }
    print(kept["mean_ratio_under_noise"])
    options.out.write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    main()
