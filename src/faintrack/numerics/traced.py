"""A function traced once, where its result's shape is needed before a loop whose body it is."""

from collections.abc import Callable
from typing import Any

import jax
from jax.extend.core import jaxpr_as_fun


def traced(function: Callable[..., Any], *arguments: Any) -> tuple[Callable[..., Any], Any]:
    """What a function does to arrays, and what it gives, by going through its Python once.

    `jax.eval_shape` and a call in the body of a loop go through it twice, and where loops are nested through the
    innermost four times: seconds, where it is a tracker.

    Parameters
    ----------
    function : of trees of arrays to such a tree.
    arguments : of the shapes and types that it will be called with.

    Returns
    -------
    The function, of arguments of the same shapes and types; and the tree of shapes and types that it gives.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> double, shape = traced(lambda values: {"twice": 2 * values}, jnp.ones(3))
    >>> double(jnp.arange(3.0))["twice"].tolist(), shape["twice"].shape
    ([0.0, 2.0, 4.0], (3,))
    """
    closed, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)
    run, structure = jaxpr_as_fun(closed), jax.tree.structure(shape)
    return lambda *given: jax.tree.unflatten(structure, run(*jax.tree.leaves(given))), shape
