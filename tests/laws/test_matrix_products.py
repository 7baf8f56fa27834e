"""Every product of real matrices asks for the full precision of its factors; by default a GPU takes less."""

from collections.abc import Callable, Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.core import ClosedJaxpr, Jaxpr

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.filters.separable import separable
from faintrack.likelihoods.contacts import Contact, GaussianContact
from faintrack.studies.kreucher2011.triangulation import filtered
from faintrack.studies.liu2013.runs import follow
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState, RangeState
from tests.region import paths, scans, tracker
from tests.scenes import LINE, Scene

KEY = jax.random.key(0)
SCENE = Scene(np.float32, LINE)
HIGHEST = (jax.lax.Precision.HIGHEST, jax.lax.Precision.HIGHEST)


def equations(jaxpr: Jaxpr) -> Iterator[Any]:
    """All equations of a program, those of its loops and branches too."""
    for equation in jaxpr.eqns:
        yield equation
        for value in jax.tree.leaves(equation.params, is_leaf=lambda each: isinstance(each, Jaxpr | ClosedJaxpr)):
            if isinstance(value, ClosedJaxpr):
                yield from equations(value.jaxpr)
            elif isinstance(value, Jaxpr):
                yield from equations(value)


def products(program: Callable[..., Any], *arguments: Any) -> list[Any]:
    """Precisions of the products of a program."""
    jaxpr, *_ = eqx.filter_make_jaxpr(program)(*arguments)
    found = [each for each in equations(jaxpr.jaxpr) if each.primitive.name == "dot_general"]
    return [each.params["precision"] for each in found if jnp.issubdtype(each.outvars[0].aval.dtype, jnp.floating)]


def beam_sums() -> Any:
    usable = jnp.ones((1, 4), bool)
    return SCENE.beamformer.scan, jnp.zeros(1), jnp.zeros((1, 16, 4)), usable


def lobe_width() -> Any:
    scan = SCENE.scan(np.ones((16, 4)))
    return SCENE.lobe_width().log_ratio, scan, SCENE.points()


def several_targets() -> Any:
    first = jax.tree.map(lambda values: values[0], scans(0, paths((0.0, 0.0, 1.0, 1.0))))
    return tracker().step, tracker().init(KEY), first, KEY


def kernels() -> Any:
    grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 8)), ("range_rate", Axis(-1.0, 1.0, 3))))
    return separable(grid, PlanarMotion(0.5), 1.0).carry, jnp.zeros(grid.shape), 0.0, 1.0, KEY


def classics() -> Any:
    return lambda key: follow(key, 5.0, 0.9, 1.0, ("ipda", "immpda")), KEY


def contact() -> Any:
    likelihood = GaussianContact(("x", "y"), jnp.eye(2), (-1.0, -1.0), (1.0, 1.0))
    return likelihood.log_ratio, Contact(jnp.array(0.0), jnp.zeros(2)), PlanarState(*jnp.zeros((4, 5)))


def bearings_in_turn() -> Any:
    return filtered, jnp.zeros((4, 2, 2))


@pytest.mark.parametrize(
    "program", [beam_sums, lobe_width, several_targets, kernels, classics, contact, bearings_in_turn]
)
def test_products_keep_the_precision_of_their_factors(program: Callable[[], Any]) -> None:
    found = products(*program())
    assert found
    assert set(found) == {HIGHEST}
