"""Tones where mains hum is heard: what a recorder makes itself has no bearing."""

from collections.abc import Mapping

MAINS = (50.0, 60.0)
"""Frequencies of the mains; Hz."""

OFF = 0.1
"""Of the mains from these at most; Hz."""

HARMONICS = 10
"""Looked at; beyond them a harmonic may lie anywhere."""


def about_hum(frequencies: Mapping[int, float]) -> tuple[str, ...]:
    """One sentence about tones that may be hum of the mains.

    Parameters
    ----------
    frequencies : of each target by its label; Hz.

    Examples
    --------
    >>> about_hum({1: 733.3, 2: 149.9})
    ('Target 2 (149.9 Hz) is where mains of 50 Hz hum: of hum in the recorder the bearing means nothing.',)
    >>> about_hum({1: 73.0})
    ()
    """
    said = []
    for mains in MAINS:
        near = {label: value for label, value in sorted(frequencies.items()) if _is_harmonic(value, mains)}
        if near:
            whose = ", ".join(f"{label} ({value:.1f} Hz)" for label, value in near.items())
            many = f"Targets {whose} are" if len(near) > 1 else f"Target {whose} is"
            said.append(f"{many} where mains of {mains:g} Hz hum: of hum in the recorder the bearing means nothing.")
    return tuple(said)


def _is_harmonic(frequency: float, mains: float) -> bool:
    number = round(frequency / mains)
    return 1 <= number <= HARMONICS and abs(frequency - number * mains) <= OFF * number
