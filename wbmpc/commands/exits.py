"""Exit codes, and the one place where an exception becomes a line of text and a code."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from enum import IntEnum
from pathlib import Path

from wbmpc.commands.annotations import annotations_of_problems, announce
from wbmpc.errors import ScenarioError, WbmpcError


class ExitCode(IntEnum):
    """What the command says to the shell."""

    PASSED = 0
    FAILED = 1  # a scenario failed
    BAD_INPUT = 2
    INTERNAL_ERROR = 3
    INTERRUPTED = 130  # Ctrl-C, as shells count it


def say(message: str) -> None:
    """One message on standard error."""
    print(message, file=sys.stderr, flush=True)


def guarded(work: Callable[[], ExitCode], *, traceback_path: Path, debug: bool) -> ExitCode:
    """Run `work` and return its exit code, or the code of the exception that ended it.

    Args:
        work: the command.
        traceback_path: where the traceback of an internal error goes.
        debug: show that traceback on standard error as well.
    """
    try:
        return work()
    except WbmpcError as error:
        say_bad_input(error)
        return ExitCode.BAD_INPUT
    except KeyboardInterrupt:
        say("interrupted")
        return ExitCode.INTERRUPTED
    except BrokenPipeError:  # `wbmpc schema | head`: the reader has had enough
        sys.stderr.close()
        return ExitCode.PASSED
    except Exception as error:
        report_internal_error(error, traceback_path, debug=debug)
        return ExitCode.INTERNAL_ERROR


def say_bad_input(error: WbmpcError) -> None:
    """The error's own lines; below each problem of a scenario file, the line that it points at; in CI, annotations."""
    if not isinstance(error, ScenarioError):
        say(str(error))
        return
    for problem in error.problems:
        say(str(problem))
        if problem.excerpt:
            say(problem.excerpt)
    announce(annotations_of_problems(error))


def report_internal_error(error: Exception, traceback_path: Path, *, debug: bool) -> None:
    """One line on standard error, the traceback in a file."""
    line, text = write_traceback(error, traceback_path)
    say(line)
    if debug:
        say(text)


def write_traceback(error: Exception, traceback_path: Path) -> tuple[str, str]:
    """Write the traceback to a file; one line that says so, and the traceback."""
    text = "".join(traceback.format_exception(error))
    try:
        traceback_path.parent.mkdir(parents=True, exist_ok=True)
        traceback_path.write_text(text, encoding="utf-8")
        where = f"traceback in {traceback_path}"
    except OSError as reason:
        where = f"no traceback written: {reason}"
    first_line = (str(error).splitlines() or [""])[0]
    return f"internal error: {type(error).__name__}: {first_line} ({where})", text
