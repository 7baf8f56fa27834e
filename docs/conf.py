"""Configuration of the documentation."""

import os
import re
from pathlib import Path

from sphinx.application import Sphinx
from sphinx_gallery.sorting import ExplicitOrder

os.environ.setdefault("XDG_CACHE_HOME", str(Path(__file__).parent / "_build" / "cache"))

project = "faintrack"
copyright = "the faintrack developers"
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx.ext.mathjax",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "gallery/README.rst"]
html_theme = "furo"
html_title = "faintrack"
html_copy_source = False
default_role = "code"
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"exclude-members": "model_config"}
python_maximum_signature_line_length = 100
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = False
# Attributes of several classes share a name, as they should.
suppress_warnings = ["ref.python"]
napoleon_use_rtype = False

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    # The others are studies, which the pages import.
    "ignore_pattern": r"^(?!plot_).*\.py$",
    "within_subsection_order": ExplicitOrder(
        [
            "plot_first_track.py",
            "plot_fixed_noise_or_unknown.py",
            "plot_likelihoods.py",
            "plot_beam_pattern.py",
            "plot_infrasound_noise.py",
            "plot_tenet.py",
            "plot_dim_aircraft.py",
            "plot_sea_clutter.py",
            "plot_marine_radar.py",
            "plot_active_sonar.py",
            "plot_bearings.py",
            "plot_infrasound_bearings.py",
            "plot_several_arrays.py",
            "plot_loud_outside.py",
            "plot_several_sources.py",
            "plot_your_own_likelihood.py",
            # Those that are not listed yet come last, in their order.
            "*",
        ]
    ),
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": False,
    "abort_on_example_error": True,
    "write_computation_times": False,
}

ENTRY = re.compile(r"^(?P<names>[A-Za-z_][\w, ]*) : (?P<text>.*)$")
ENTRIES = ("Parameters", "Attributes", "Raises")


def spread_entries(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Turn `name : what it is` into the two lines that napoleon expects, and a Returns section into one field."""
    section, result = "", []
    for number, line in enumerate(lines):
        if number + 1 < len(lines) and re.fullmatch(r"-{3,}", lines[number + 1]):
            section = line.strip()
            if section == "Returns":
                result += ["", "", ":returns:", ""]  # two blank lines end the section before
                continue
        if section == "Returns":
            if not re.fullmatch(r"-{3,}", line):
                result.append(f"    {line}" if line else "")
            continue
        entry = ENTRY.match(line) if section in ENTRIES else None
        result += [entry["names"], f"    {entry['text']}"] if entry else [line]
    lines[:] = result


def shorten_arrays(
    app: Sphinx, what: str, name: str, obj: object, options: object, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Write `Array` where the signature has the private place of JAX's class."""
    short, short_returns = (text and text.replace("jaxlib._jax.Array", "Array") for text in (signature, returns))
    return short, short_returns


def setup(app: Sphinx) -> None:
    app.connect("autodoc-process-signature", shorten_arrays)
    # Before napoleon, which listens at 500.
    app.connect("autodoc-process-docstring", spread_entries, priority=400)
