"""Noise that is correlated between channels: its share is found again, and its algebra is that of the covariance."""

import dataclasses
from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.likelihoods.array_field import Sources, beams_beside, beside, in_noise
from faintrack.sensors.array import line_array
from faintrack.sensors.beams import BeamScan
from faintrack.signal.array_background import SHARES, ArrayBackground, Learnt, array_background, isotropic
from faintrack.signal.beamformer import Beamformer, beamformer

ARRAY = line_array(8, 1.0)
FRAMES = 40


def planned() -> tuple[Beamformer, ArrayBackground]:
    plan = beamformer(ARRAY, 2000.0, 0.5, (100.0, 700.0), beams=31, snapshot=0.0625)
    return plan, array_background(plan)


def drawn(plan: Beamformer, share: float, count: int, seed: int = 0) -> list[BeamScan]:
    """Frames of noise with a share that is isotropic."""
    rng = np.random.default_rng(seed)
    roots = np.linalg.cholesky(
        (1 - share) * np.eye(8) + share * isotropic(ARRAY, plan.grid.frequency) + 1e-9 * np.eye(8)
    )
    scans = []
    for number in range(count):
        shape = (plan.grid.snapshots, len(roots), 8)
        white = (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)
        spectra = jnp.asarray(np.einsum("fij,kfj->kfi", roots, white), jnp.complex64)
        scans.append(plan.scan_frame(jnp.asarray(float(number)), spectra))
    return scans


QUIET = jnp.asarray(-jnp.inf)


def in_white(background: ArrayBackground, scan: BeamScan) -> BeamScan:
    """Frame with nothing in its background."""
    return in_noise(scan, background.noise(background.init(), scan, jnp.asarray(jnp.inf)))


def remembered(background: ArrayBackground, scans: list[BeamScan]) -> Learnt:
    """What is remembered after some frames without a source."""
    learnt = background.init()
    for scan in scans:
        learnt = background.learn(learnt, scan, partial(in_white, background, scan), QUIET)
    return learnt


@pytest.mark.parametrize(
    "share", [0.1, pytest.param(0.0, marks=pytest.mark.slow), pytest.param(0.5, marks=pytest.mark.slow)]
)
def test_the_share_is_found_again(share: float) -> None:
    plan, background = planned()
    found = SHARES[np.asarray(remembered(background, drawn(plan, share, FRAMES)).share)]
    # 16 of 40 frames, of 8 snapshots in 9 bins: the share is known to a tenth of itself, its steps are a third.
    assert np.median(found) == pytest.approx(share, rel=0.5, abs=0.006)
    assert np.mean(np.abs(found - share) <= 0.5 * share + 0.011) > 0.9


def test_inverse_gain_and_dimensions() -> None:
    plan, background = planned()
    scans = drawn(plan, 0.3, FRAMES)
    learnt = remembered(background, scans)
    noise = background.noise(learnt, scans[0], QUIET)
    shares = SHARES[np.asarray(learnt.share)]
    gamma = isotropic(ARRAY, plan.grid.frequency)
    known = Sources(*(jnp.asarray([value]) for value in (1.0, 0.02, 0.3, 0.8)))
    scan = beside(plan, in_noise(scans[0], noise), known)
    power, gain = beams_beside(plan, in_noise(scans[0], noise))
    for number, frequency in enumerate(plan.grid.frequency):
        inverse = np.linalg.inv((1 - shares[number]) * np.eye(8) + shares[number] * gamma[number])
        beams = np.exp(-2j * np.pi * frequency * np.asarray(ARRAY.delays(np.asarray(plan.grid.bearing))))
        z = np.asarray(scans[0].spectra)[:, number]
        np.testing.assert_allclose(gain[number], np.einsum("bi,ij,bj->b", beams.conj(), inverse, beams).real, rtol=1e-3)
        products = np.abs(np.einsum("bi,ij,kj->kb", beams.conj(), inverse, z)) ** 2
        np.testing.assert_allclose(power[number], products.sum(axis=0), rtol=2e-3, atol=1e-2)
    # The model fits: hardly a dimension is missing; a source in the background takes some more.
    assert np.all(np.asarray(noise.dimensions) <= 8)
    assert np.median(noise.dimensions) > 7.6
    assert np.all(np.asarray(scan.field.dimensions) <= np.asarray(noise.dimensions) + 1e-4)


def test_a_loud_source_and_a_missing_channel_leave_white_noise() -> None:
    plan, background = planned()
    scans = drawn(plan, 0.5, 6)
    learnt = remembered(background, scans)
    fewer = dataclasses.replace(scans[0], channels=jnp.asarray(7.0))
    for scan, loudest in ((scans[0], 30.0), (fewer, -20.0)):
        noise = background.noise(learnt, scan, jnp.asarray(loudest))
        np.testing.assert_array_equal(noise.weights, 1)
        np.testing.assert_array_equal(noise.gain, scan.channels)
        after = background.learn(learnt, scan, partial(in_white, background, scan), jnp.asarray(loudest))
        np.testing.assert_array_equal(after.powers, learnt.powers)


def test_the_first_frame_is_its_own_background() -> None:
    plan, background = planned()
    scan = drawn(plan, 0.5, 1)[0]
    of_itself = background.noise(background.init(), scan, QUIET)
    learnt = background.learn(background.init(), scan, partial(in_white, background, scan), QUIET)
    np.testing.assert_array_equal(of_itself.weights, background.noise(learnt, scan, QUIET).weights)
