r"""The other way round: bearings tracked array by array, then intersected.

The best case, which no tracker reaches: which beams are whose is known. The bearing measured of a target is the middle
of the strongest of the three beams around it (`measured_bearings`), or of the very beam that it is in, as the paper has
it by hand (`true_bearings`). A Kalman filter with a nearly constant bearing rate follows each; where the two filtered
bearings cross is the position.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.baselines.pda import Gaussian, extended
from faintrack.numerics.precision import full_precision
from faintrack.sensors.stations import EnergyScan, Stations
from faintrack.studies.kreucher2011.scene import DEGREE, FANS, NOISE
from faintrack.targets.motion import white_acceleration
from faintrack.targets.states import PlanarState

RANGE = 1000.0
"""Distance at which an acceleration across the line of sight is that of a bearing; m."""

BEARING_STD = DEGREE / 12**0.5
"""Of a bearing within its beam; radians."""

Bearings = Float[Array, "scan array target"]


def true_bearings(scans: EnergyScan, states: PlanarState) -> Bearings:
    """Middles of the beams that targets are in."""
    return _middle(jax.vmap(FANS.beams)(scans.stations, states))


def measured_bearings(scans: EnergyScan, states: PlanarState) -> Bearings:
    """Middles of the strongest beams among those that targets are in and their neighbours."""
    around = jax.vmap(FANS.beams)(scans.stations, states)[..., None] + jnp.arange(-1, 2)
    energy = jnp.take_along_axis(scans.energy[:, :, None, :], jnp.clip(around, 0, FANS.most - 1), axis=3)
    strongest = jnp.argmax(energy, axis=3, keepdims=True)
    return _middle(jnp.take_along_axis(around, strongest, axis=3)[..., 0])


@full_precision
def filtered(bearings: Bearings) -> Bearings:
    """Bearings after a Kalman filter, scans a second apart."""
    a, b, c = (NOISE / RANGE * factor for factor in white_acceleration(1.0))
    noise = jnp.array([[a * a + b * b, a * c], [a * c, c * c]])
    move = jnp.array([[1.0, 1.0], [0.0, 1.0]])
    error = jnp.array([[BEARING_STD**2]])

    def one(bearings: Float[Array, " scan"]) -> Float[Array, " scan"]:
        start = Gaussian(jnp.stack([bearings[0], 0.0]), jnp.diag(jnp.array([BEARING_STD, 10 / RANGE]) ** 2))

        def step(state: Gaussian, bearing: Array) -> tuple[Gaussian, Array]:
            ahead = Gaussian(move @ state.mean, move @ state.covariance @ move.T + noise)
            innovation = extended(ahead, lambda mean: mean[:1], error)
            mean = ahead.mean + innovation.gain @ (bearing[None] - innovation.expected)
            after = Gaussian(mean, ahead.covariance - innovation.gain @ innovation.covariance @ innovation.gain.T)
            return after, after.mean[0]

        return jnp.concatenate([bearings[:1], jax.lax.scan(step, start, bearings[1:])[1]])

    return jax.vmap(jax.vmap(one, in_axes=1, out_axes=1), in_axes=2, out_axes=2)(bearings)


def crossing(stations: Stations, bearings: Bearings) -> Float[Array, "scan target 2"]:
    """Where the bearings of the two arrays, lines that point east, cross to the north of them; m."""
    along = jnp.stack([jnp.cos(bearings), jnp.sin(bearings)], axis=-1)
    near, far = along[:, 0], along[:, 1]
    apart = jnp.stack([stations.x[1] - stations.x[0], stations.y[1] - stations.y[0]])
    turned = near[..., 0] * far[..., 1] - near[..., 1] * far[..., 0]
    distance = (apart[0] * far[..., 1] - apart[1] * far[..., 0]) / turned
    return jnp.stack([stations.x[0], stations.y[0]]) + distance[..., None] * near


def _middle(beams: Array) -> Array:
    return FANS.first[0] + FANS.step[0] * beams
