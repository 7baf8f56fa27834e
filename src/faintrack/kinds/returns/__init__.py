"""Returns of an active sonar: what exceeds a threshold after each ping, tracked on a grid of positions and velocities.

Returns go to their bins (`faintrack.signal.pings`), every cell is weighed by the mean likelihood ratio of returns and
quiet bins over it (`faintrack.likelihoods.guided`), and a Bernoulli filter on the grid follows one target at a time.
"""

from pathlib import Path
from typing import Any

from faintrack.data.returns import Returns
from faintrack.kinds.kind import Kind
from faintrack.kinds.returns.sections import ReturnsScenario
from faintrack.kinds.rooms import room


def _holds(paths: tuple[Path, ...]) -> bool:
    from faintrack.io.columns import column_names

    # Contacts have a delay, too, and need no level.
    return len(paths) == 1 and {"delay_s", "snr_db"} <= column_names(paths[0])


def _takes(paths: tuple[Path, ...]) -> bool:
    """Samples of hydrophones become returns."""
    from faintrack.io.recordings import READERS

    return not _holds(paths) and all(path.suffix.lower() in READERS for path in paths)


def _write(path: Path, data: Any) -> None:
    if isinstance(data, Returns):
        from faintrack.io.returns import write_returns

        write_returns(path, data)
        return
    from faintrack.io.write_recordings import write_recording
    from faintrack.kinds.returns.hydrophones import blocks

    write_recording(path, blocks(data), data.sample_rate, data.channel_names, data.start_time)


def _read(paths: tuple[Path, ...], scenario: ReturnsScenario | None) -> Returns:
    from faintrack.errors import InputError
    from faintrack.io.returns import read_returns

    if _takes(paths):
        from faintrack.kinds.returns.hydrophones import read

        return read(paths, scenario)
    if len(paths) > 1:
        raise InputError(f"{len(paths)} files of returns were given; expected one file.")
    return read_returns(paths[0])


def _describe(returns: Returns) -> dict[str, str]:
    import numpy as np

    apart = f", {np.min(np.diff(returns.times)):g} s apart" if returns.length > 1 else ""
    moving = [name for name in ("source", "receiver") if getattr(returns, name) is not None]
    facts = {
        "holds": f"{returns.length} pings{apart}",
        "returns": f"{len(returns.delay)}, {returns.counts.max()} at most in a ping",
        "span": f"{returns.times[-1] - returns.times[0]:g} s",
    }
    for platform, labels in zip(("sources", "receivers"), zip(*returns.pairs, strict=True), strict=False):
        if any(labels):
            facts[platform] = ", ".join(dict.fromkeys(labels))
    for number, labels in enumerate(returns.pairs):
        part = returns.of_pair(number)
        there = returns.reported[:, number] if returns.reported is not None else np.ones(returns.length, bool)
        facts[" to ".join(label for label in labels if label)] = (
            f"{len(part.delay)} returns in {there.sum()} pings, {part.counts.max()} at most in a ping"
        )
    if len(returns.delay):
        snr_db = 10 * np.log10(returns.power)
        facts["delays"] = f"{returns.delay.min():g} to {returns.delay.max():g} s"
        facts["levels"] = f"{snr_db.min():.3g} to {snr_db.max():.3g} dB over the noise"
    doppler = "not measured"
    if returns.doppler is not None and len(returns.doppler):
        doppler = f"{returns.doppler.min():g} to {returns.doppler.max():g} Hz"
    return {**facts, "doppler": doppler, "platforms": f"{' and '.join(moving) or 'none'} in columns of the file"}


KIND = Kind(
    name="returns",
    title="Returns of an active sonar",
    scenario=ReturnsScenario,
    data=Returns,
    holds=_holds,
    read=_read,
    write=_write,
    plan=room("faintrack.kinds.returns.plan", "plan"),
    simulate=room("faintrack.kinds.returns.simulate", "simulate"),
    targets=room("faintrack.kinds.returns.simulate", "targets"),
    silence=room("faintrack.kinds.returns.simulate", "silence"),
    describe=_describe,
    about=room("faintrack.kinds.returns.report", "about"),
    draw=room("faintrack.kinds.returns.pictures", "draw"),
    shown="Position, velocity, existence, returns",
    needs=("--scenario FILE",),
    takes=_takes,
    surrogate=lambda data, scenario, seed: room("faintrack.kinds.surrogates", "exchanged")(data, seed),
    stretch=room("faintrack.kinds.stretches", "of_returns"),
    gained=room("faintrack.kinds.promise", "gained_by_target"),
)
