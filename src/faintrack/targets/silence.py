r"""A target that may fall silent: pulses, fades, passes behind something, and is the same when it is heard again.

A target in hand is observable, silent or gone (as by Musicki, Evans and Stankovic, *Integrated probabilistic data
association*, 1994, Markov chain two), here in continuous time. With f the rate at which it falls silent, r and g those
at which a silent one becomes observable or is gone, and :math:`\mu` the departure rate of one that is observable, the
probabilities p of observable and u of silent obey

.. math:: \dot p = -(f + \mu) p + r u, \qquad \dot u = f p - (r + g) u .

Two predictions over T so equal one over 2 T. A scan without the target costs the probability of falling silent once,
not once a scan, and a track outlives the silence of its target by about one over :math:`r + g`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

Scalar = Float[Array, ""] | float


class Silence(eqx.Module):
    """How often targets fall silent, and for how long.

    Attributes
    ----------
    falls : rate at which one that is observable falls silent; per second.
    returns : rate at which one that is silent becomes observable; per second.
    ends : rate at which one that is silent is gone; per second.
    """

    falls: Scalar
    returns: Scalar
    ends: Scalar

    def forecast(
        self,
        log_odds: Float[Array, ""],
        observable: Float[Array, ""],
        departure_rate: Scalar,
        interval: Scalar,
        log_lost: Float[Array, ""],
    ) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Odds after an interval (the module's chain, solved).

        Parameters
        ----------
        log_odds : natural log of the odds that the target exists.
        observable : natural log of the odds that it is observable, if it exists.
        departure_rate : of a target that is observable; per second.
        interval : seconds.
        log_lost : natural log of the probability that it has moved out of the region.

        Returns
        -------
        `log_odds` and `observable` at the end.

        Examples
        --------
        >>> never = Silence(falls=0.1, returns=0.0, ends=0.0)
        >>> odds, observable = never.forecast(jnp.array(2.0), jnp.array(jnp.inf), 0.0, 1.0, jnp.array(-jnp.inf))
        >>> round(float(odds), 4), round(float(jax.nn.sigmoid(observable)), 4)
        (2.0, 0.9048)
        """
        leaves, ends = departure_rate, self.ends
        of_observable, of_silent = self.falls + leaves, self.returns + ends
        half = (of_silent - of_observable) / 2
        root = jnp.sqrt(half**2 + self.falls * self.returns)
        # Two modes that are one are told apart by a thousandth: their difference is divided by.
        root = jnp.maximum(
            root, jnp.maximum(1e-3 * (of_observable + of_silent) / 2, jnp.finfo(log_odds.dtype).tiny ** 0.5)
        )
        rates = jnp.stack([-(of_observable + of_silent) / 2 + root, -(of_observable + of_silent) / 2 - root])
        shares = jnp.stack([1 + half / root, 1 - half / root]) / 2
        # The slower rate is the difference of nearly equal numbers where few changes happen.
        product = leaves * of_silent + self.falls * ends
        slow = jnp.where(rates[1] < 0, product / jnp.minimum(rates[1], -1e-30), 0)
        rates = rates.at[0].set(jnp.where(root > 0.5 * jnp.abs(rates[1]), slow, rates[0]))

        def chances(modes: Array) -> tuple[Array, ...]:
            """Observable to observable, observable to silent, silent to observable, silent to silent."""
            apart = (modes[0] - modes[1]) / (2 * root)
            return shares @ modes, self.falls * apart, self.returns * apart, shares[::-1] @ modes

        stays, falls, returns, remains = chances(jnp.exp(rates * interval))
        safe = jnp.where(rates < 0, rates, -1.0)
        spent = chances(jnp.where(rates < 0, jnp.expm1(safe * interval) / safe, interval))
        gone_observable, gone_silent = leaves * spent[0] + ends * spent[1], leaves * spent[2] + ends * spent[3]

        exists, absent = jax.nn.log_sigmoid(log_odds), jax.nn.log_sigmoid(-log_odds)
        loud, silent = exists + jax.nn.log_sigmoid(observable), exists + jax.nn.log_sigmoid(-observable)
        log_kept = jnp.log1p(-jnp.minimum(jnp.exp(log_lost), 1))

        def both(from_observable: Array, from_silent: Array) -> Float[Array, ""]:
            return jnp.logaddexp(
                loud + jnp.log(jnp.maximum(from_observable, 0)), silent + jnp.log(jnp.maximum(from_silent, 0))
            )

        now_observable, now_silent = both(stays, returns) + log_kept, both(falls, remains) + log_kept
        gone = jnp.logaddexp(jnp.logaddexp(both(gone_observable, gone_silent), absent), exists + log_lost)
        return jnp.logaddexp(now_observable, now_silent) - gone, now_observable - now_silent
