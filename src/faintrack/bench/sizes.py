"""How large the problems of the benchmark are."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Sizes:
    """Sizes of the published targets; tests take smaller ones.

    Attributes
    ----------
    recording_seconds : of the recording that is tracked.
    channels, beams : of the array.
    particles, births : of the tracker on beam power.
    bearing_particles, bearing_births : of the tracker on bearings in clutter.
    batch : runs side by side.
    steps : scans of a simulated run.
    repeat_seconds : that every call is repeated.
    """

    recording_seconds: int = 60
    channels: int = 55
    beams: int = 180
    particles: int = 1000
    births: int = 250
    bearing_particles: int = 3000
    bearing_births: int = 750
    batch: int = 64
    steps: int = 60
    repeat_seconds: float = 2.0
