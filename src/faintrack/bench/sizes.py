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
    detectors : grids of four dimensions side by side.
    places, rates : cells of such a grid along each component and along its rate.
    small_places, small_rates : the same of smaller detectors, sixteen side by side (kreucher2011).
    region_places, region_rates : the same of sixteen large ones, for a GPU.
    followers : particles of a target that is followed among several.
    scans : of several arrays.
    base, fine : cells along a component and along its rate, of grids with kernels (aughenbaugh2010).
    peer_cells : along every axis of the peer's grid of four dimensions.
    pixels : of an image, along each side.
    pixel_particles, pixel_births : of the tracker on images.
    target_scans, target_pixels : of data with one target and several; pixels along each side of a frame.
    archive_seconds : of a segment of an archive.
    study : that is run as a whole.
    repeat_seconds : that every call is repeated.
    """

    recording_seconds: int = 60
    channels: int = 55
    beams: int = 180
    particles: int = 1000
    births: int = 250
    bearing_particles: int = 3000
    bearing_births: int = 750
    batch: int = 100
    steps: int = 60
    detectors: int = 4
    places: int = 51
    rates: int = 13
    small_places: int = 26
    small_rates: int = 21
    region_places: int = 200
    region_rates: int = 25
    followers: int = 2048
    scans: int = 4
    base: tuple[int, int] = (51, 7)
    fine: tuple[int, int] = (73, 11)
    peer_cells: int = 21
    pixels: int = 256
    pixel_particles: int = 80_000
    pixel_births: int = 20_000
    target_scans: int = 20
    target_pixels: int = 64
    archive_seconds: int = 300
    study: str = "liu2013"
    repeat_seconds: float = 2.0
