"""Decisions: each threshold is where two expected costs, or two probabilities, are equal."""

import numpy as np
import pytest
from scipy.special import expit

from faintrack.errors import InputError
from faintrack.metrics.declarations import IDEAL_RECEIVER, bayes_risk, confidence


@pytest.mark.parametrize("costs", [(10.0, 2.0, 0.0, 0.0), (1.0, 300.0, -5.0, 0.5)])
def test_at_the_threshold_both_decisions_cost_the_same(costs: tuple[float, ...]) -> None:
    false_alarm, miss, detection, rejection = costs
    for log_odds, cheaper in ((bayes_risk(*costs) + 0.1, 1), (bayes_risk(*costs) - 0.1, 0)):
        there = expit(log_odds)
        declare = there * detection + (1 - there) * false_alarm
        refrain = there * miss + (1 - there) * rejection
        assert (declare < refrain) == cheaper


def test_the_ideal_receiver_makes_fewest_mistakes() -> None:
    assert bayes_risk(1.0, 1.0) == IDEAL_RECEIVER == confidence(0.5)
    np.testing.assert_allclose(expit(confidence(0.97)), 0.97)


def test_what_is_no_decision_is_refused() -> None:
    with pytest.raises(InputError, match="expected false_alarm above rejection"):
        bayes_risk(1.0, 1.0, detection=2.0)
    for probability in (0.0, 1.0, np.nan):
        with pytest.raises(InputError, match="expected a number between 0 and 1"):
            confidence(probability)
