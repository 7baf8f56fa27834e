"""The commands put together."""

from typing import Annotated

import typer

from faintrack.cli import archive, commands, lines, live, study

app = typer.Typer(
    name="faintrack",
    help="Detect and follow targets too quiet to threshold, from raw sensor data.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
)
for command in (
    commands.demo,
    commands.info,
    commands.init,
    commands.explain,
    commands.track,
    live.live,
    lines.lofar,
    lines.demon,
    commands.report,
    commands.export,
    commands.simulate,
    commands.calibrate,
    commands.bench,
):
    app.command(command.__name__)(command)
app.add_typer(archive.app, name="archive")
app.add_typer(study.app, name="study")


def _version(wanted: bool | None) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"faintrack {version('faintrack')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool | None, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and end.")
    ] = None,
) -> None:
    """Options of the program itself."""
