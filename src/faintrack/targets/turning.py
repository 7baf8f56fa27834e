r"""What a turn of the array does to what is believed of targets.

States of an array have bearings from the array itself. Where it turns by :math:`\Delta` clockwise, a target that keeps
its true bearing is seen :math:`\Delta` further to port, so before targets move themselves every bearing is turned back,

.. math:: \beta \leftarrow \beta - \Delta,

and rates are those of an array that keeps its heading. The time of a heading is known to a scan either way, and
what that makes wrong in :math:`\Delta` is a share of its change since the scan before, anywhere from -1 to 1: bearings
are moved apart by its deviation, :math:`|\Delta - \Delta'| / \sqrt{3}`. A line hears the angle from its axis alone, a
target to starboard as one to port. So each point of a belief has a **side** :math:`s = \pm 1`, and what turns is
:math:`s \beta`: a turn moves the two sides apart, and the scans that follow tell which one was right.

Until there is a turn the two sides are each other's mirror image: a target that appeared since the line last turned is
on either with the same probability, whatever scans say. So its points are dealt to both sides anew in every scan, and
none of the two is lost by the chance of resampling however long the line keeps its heading.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief
from faintrack.numerics.draws import normal
from faintrack.targets.motion import BearingMotion
from faintrack.targets.states import BearingState, SidedState


class SidedMotion(eqx.Module):
    """Motion of a direction from a line, on the side that it is on; one that crosses the axis changes sides.

    Attributes
    ----------
    around : motion around the full circle.
    """

    around: BearingMotion

    def move(self, states: SidedState, interval: Float[Array, ""] | float, key: PRNGKeyArray) -> SidedState:
        """Draw the states after `interval` seconds."""
        return _sided(self.around.move(_signed(states), interval, key))


def turned(states: Any, angle: Float[Array, "*points"] | float) -> Any:
    """States after the array has turned, its targets where they were (the module's equation).

    Parameters
    ----------
    states : with `bearing` around the full circle, or a `faintrack.targets.states.SidedState`.
    angle : clockwise; radians.

    Examples
    --------
    >>> one = jnp.ones(2)
    >>> states = turned(SidedState(1.5 * one, 0.1 * one, one, jnp.array([1.0, -1.0])), 0.5)
    >>> states.bearing.round(3).tolist(), states.side.tolist()
    ([1.0, 2.0], [1.0, -1.0])
    """
    if isinstance(states, SidedState):
        return _sided(turned(_signed(states), angle))
    bearing, _ = BearingMotion(circular=True).within(states.bearing - angle, states.bearing_rate)
    return dataclasses.replace(states, bearing=bearing)


def turned_beliefs(
    tree: Any, angle: Float[Array, ""], unsure: Float[Array, ""], steady_since: Float[Array, ""], key: PRNGKeyArray
) -> Any:
    """Whatever holds beliefs, after the array has turned.

    Parameters
    ----------
    tree : state of a tracker; its beliefs are found in it, alone or stacked.
    angle : by which the array has turned since the scan before, clockwise; radians.
    unsure : standard deviation of the angle; radians.
    steady_since : since when, up to the scan before, a line had kept its heading; points born since then are dealt to
        both sides.
    key : random key.
    """

    def of_belief(belief: Any) -> Any:
        if not isinstance(belief, Belief):
            return belief
        states: Any = belief.states
        if isinstance(states, SidedState):
            assert belief.born is not None
            both = jnp.where(jnp.arange(states.side.shape[-1]) % 2 == 0, 1, -1).astype(states.side.dtype)
            alike = (belief.born >= steady_since) | (states.side == 0)
            side = jnp.where(alike, both, states.side)
            states = dataclasses.replace(states, side=side)
        # Not by its constructor: beliefs may be stacked.
        off = unsure * normal(key, states.bearing.shape, states.bearing.dtype)
        return eqx.tree_at(lambda held: held.states, belief, turned(states, angle + off))

    return jax.tree.map(of_belief, tree, is_leaf=lambda node: isinstance(node, Belief))


def _signed(states: SidedState) -> BearingState:
    """Directions clockwise from the axis, -pi to pi."""
    side = jnp.where(states.side < 0, -1, 1).astype(states.bearing.dtype)
    return BearingState(side * states.bearing, side * states.bearing_rate, states.snr_db)


def _sided(states: BearingState) -> SidedState:
    side = jnp.where(states.bearing < 0, -1, 1).astype(states.bearing.dtype)
    return SidedState(jnp.abs(states.bearing), side * states.bearing_rate, states.snr_db, side)
