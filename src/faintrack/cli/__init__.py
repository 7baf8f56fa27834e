"""The command line: it reads, calls and prints, and does no arithmetic of its own.

What a command needs is imported when it runs, so that `--help` answers at once.
"""

import sys

INTERRUPTED = "faintrack: interrupted; no result was written."


def main() -> None:
    """Run the command line; input that cannot be used is one sentence on standard error and exit status 2."""
    import gc
    import signal
    from types import FrameType

    class Terminated(BaseException):
        """The system asks the process to end."""

    def end(number: int, frame: FrameType | None) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, end)
    try:
        # Objects made between two searches for garbage: with Python's 700 they take a third of the time of imports.
        gc.set_threshold(100_000)
        from faintrack.cli.app import app
        from faintrack.errors import InputError

        try:
            app()
        except SystemExit as ending:
            # Typer turns an interruption into a silent end; a command that has told of it cuts the cause off.
            if isinstance(getattr(ending.__context__, "__cause__", None), KeyboardInterrupt):
                raise KeyboardInterrupt from None
            raise
        except InputError as error:
            print(f"faintrack: {error}", file=sys.stderr)
            sys.exit(2)
        except BrokenPipeError:
            # Whoever read the output has closed it.
            sys.stderr.close()
            sys.exit(1)
    except KeyboardInterrupt:
        print(INTERRUPTED, file=sys.stderr)
        sys.exit(130)
    except Terminated:
        print(INTERRUPTED, file=sys.stderr)
        sys.exit(143)
    finally:
        signal.signal(signal.SIGTERM, before)
        # What the process leaves behind goes with it: a last search through it takes a second.
        gc.freeze()
