"""A command group that ends wrong input in one line, and streams that may be gone or full."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from typing import Any

import click

from ..device.checks import LOST, WRONG_INPUT, InputError, OutputError


class OneLineGroup(click.Group):
    """A command group that reports input errors in one line and exits with code 2."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the options before the command."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            ctx.exit(refused(f"{error.format_message()} (see warp-pd --help)"))

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        from ..distributed import processes_here
        from ..run.stopping import SIGNALS, deadline

        try:
            with deadline.within(SIGNALS) if processes_here() == 1 else contextlib.nullcontext():
                return super().invoke(ctx)
        except click.UsageError as error:
            where = error.ctx.command_path if error.ctx is not None else "warp-pd"
            ctx.exit(refused(f"{error.format_message()} (see {where} --help)"))
        except RuntimeError as error:
            from ..communicator import LAUNCHER_REPORTS, LostError

            if not isinstance(error, LostError):
                raise
            if LAUNCHER_REPORTS not in os.environ:
                tell(f"warp-pd: {error}", err=True)
            # What still waits for the other process would hang.
            os._exit(LOST)
        except KeyboardInterrupt:
            say("interrupted")
            ctx.exit(deadline.exit_code)
        except OSError as error:
            # Python's reader of a pipe that ended, such as `head`, is click's; a full disk is told in a line.
            if error.errno == errno.EPIPE:
                raise
            ctx.exit(refused(str(error)))
        except (InputError, MemoryError) as error:
            code = refused(str(error))
            if isinstance(error, OutputError):
                # HDF5 crashes at the exit of a process in which a file could not be written.
                release_lost_streams()
                os._exit(code)
            ctx.exit(code)


def refused(text: str) -> int:
    """Print the reason why input is refused, and return the exit code."""
    say(text)
    return WRONG_INPUT


def say(text: str) -> None:
    """Print one line to stderr, from the first process only."""
    from ..distributed.launch import is_first

    if is_first():
        tell(f"warp-pd: {text}", err=True)


def tell(line: str, err: bool = False) -> None:
    """Print a line; a terminal or a log that is gone does not end a run, whose results are in its files."""
    with contextlib.suppress(OSError, ValueError):
        click.echo(line, err=err)


def release_lost_streams() -> None:
    """Flush standard streams; what cannot be written goes nowhere, so that it does not change the exit code."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError, AttributeError):
            with contextlib.suppress(OSError, ValueError, AttributeError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def open_closed_streams() -> None:
    """Open what the caller closed of descriptors 0 to 2; a result file would get the number, and what is printed."""
    while (opened := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(opened)
