"""Too little evidence from several arrays is told before a run."""

import dataclasses

import pytest

from faintrack.kinds.records.checks import about_evidence
from faintrack.likelihoods.beam_energies import BeamEnergies
from faintrack.trackers.several import SeveralTargetsTracker
from tests.region import FANS, tracker


def heard(level: float) -> SeveralTargetsTracker:
    """The small region's tracker, of targets so loud: two detectors of 9 x 16 cells of 50 m, up to 6.25 m/s."""
    likelihood = BeamEnergies(FANS, present_mean=level)
    return dataclasses.replace(tracker(), trackers=dataclasses.replace(tracker().trackers, likelihood=likelihood))


def test_loud_targets_pass() -> None:
    assert about_evidence(heard(4.0), 1.0) == ()


def test_faint_targets_are_told_with_what_they_take() -> None:
    """Without others a beam adds half the squared level, 0.045 nats; a detector is 450 m wide."""
    (said,) = about_evidence(heard(0.3), 1.0)
    assert said.startswith("A target adds 0.09 nats of evidence a scan, all 2 arrays together")
    assert "stay in a detector for 72 s" in said


def test_scans_that_come_seldom_are_too_little_evidence_as_well() -> None:
    assert about_evidence(heard(3.0), 1.0) == ()
    assert about_evidence(heard(3.0), 20.0)


@pytest.mark.parametrize("level", [1.0, 3.0])
def test_a_beam_without_others_adds_half_the_squared_level(level: float) -> None:
    found = BeamEnergies(FANS, present_mean=level).mean_log_ratio()
    assert found.tolist() == pytest.approx([level**2 / 2] * 2, rel=1e-4)
