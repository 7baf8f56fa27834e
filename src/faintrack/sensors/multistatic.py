"""One ping of a multistatic sonar: what each pair of a source and a receiver heard of it.

Pairs that report at one time are one scan. One that does not report, since its source was silent or its receiver was
off, tells nothing; one that reports no return tells that nothing was heard.
"""

import equinox as eqx
from jaxtyping import Array, Bool, Float

from faintrack.sensors.active import Ping


class Pings(eqx.Module):
    """Returns of all pairs at one time, or a stack of them.

    Attributes
    ----------
    time : of transmission; seconds.
    pings : returns, a pair each.
    reported : whether a pair reported, if only that it heard nothing.
    """

    time: Float[Array, "*ping"]
    pings: tuple[Ping, ...]
    reported: Bool[Array, "*ping pair"]
