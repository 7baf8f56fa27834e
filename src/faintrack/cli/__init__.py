"""The command line: it reads, calls and prints, and does no arithmetic of its own.

What a command needs is imported when it runs, so that `--help` answers at once.
"""

import gc
import sys
from typing import Annotated

import typer

from faintrack.cli import commands, study
from faintrack.errors import InputError

app = typer.Typer(
    name="faintrack",
    help="Detect and follow targets too quiet to threshold, from raw sensor data.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
)
app.command("demo")(commands.demo)
app.command("simulate")(commands.simulate)
app.command("track")(commands.track)
app.command("report")(commands.report)
app.command("info")(commands.info)
app.command("init")(commands.init)
app.command("calibrate")(commands.calibrate)
app.command("bench")(commands.bench)
app.add_typer(study.app, name="study")


@app.callback(invoke_without_command=True)
def _options(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        from importlib.metadata import version as version_of

        print(f"faintrack {version_of('faintrack')}")
        raise typer.Exit


SELDOM = 100_000
"""Objects made between two searches for garbage: with Python's 700 they take a third of the time that imports do."""


def main() -> None:
    """Run the command line; input that cannot be used is one sentence on standard error and exit status 2."""
    gc.set_threshold(SELDOM)
    try:
        app()
    except InputError as error:
        print(f"faintrack: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("faintrack: interrupted; no result was written.", file=sys.stderr)
        sys.exit(130)
    finally:
        # What the process leaves behind goes with it: a last search through it takes a second.
        gc.freeze()
