"""Entry of `python -m faintrack.cli`."""

from faintrack.cli import main

main()
