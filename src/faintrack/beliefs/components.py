"""What a state is made of: named components, and what is known of each.

A state is any dataclass that JAX takes for a tree, an `equinox.Module` for one; its fields are its components. It may
say three things of them in class variables: `angles` names those that are averaged as directions, `rates` tells the
rate of each component that has one, `signs` names those that are 1 or -1 and have nothing between. A state that says
none of it has no angles, no rates and no signs.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any


def components(state: Any) -> dict[str, Any]:
    """Components of a state by their names, in their order.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from faintrack.targets.states import RangeState
    >>> {name: float(values) for name, values in components(RangeState(jnp.array(30.0), jnp.array(-1.0))).items()}
    {'range': 30.0, 'range_rate': -1.0}
    """
    return {field.name: getattr(state, field.name) for field in dataclasses.fields(state)}


def angles(state: Any) -> tuple[str, ...]:
    """Components of a state, or of a kind of state, that are averaged as directions; none where it names none.

    Examples
    --------
    >>> from faintrack.targets.states import BearingState
    >>> angles(BearingState)
    ('bearing',)
    """
    return getattr(state, "angles", ())


def rates(state: Any) -> Mapping[str, str]:
    """Component of a state, or of a kind of state, to its rate; empty where it names none.

    Examples
    --------
    >>> from faintrack.targets.states import PlanarState
    >>> rates(PlanarState)
    {'x': 'vx', 'y': 'vy'}
    """
    return getattr(state, "rates", {})


def signs(state: Any) -> tuple[str, ...]:
    """Components of a state, or of a kind of state, that are 1 or -1; none where it names none.

    Examples
    --------
    >>> from faintrack.targets.states import SidedState
    >>> signs(SidedState)
    ('side',)
    """
    return getattr(state, "signs", ())
