"""Stands in for the programs that the documents call: `wbmpc` with short runs, `make -n`, and the like.

The workspace's .venv/bin has each of them. `DOCS_TEST_PROGRAM` says which one is called, `DOCS_TEST_MODE` is the
mode of the block: whole runs everything as written; short ends every run after 0.5 s, in one process, with two files,
draws or delays of many; parse runs nothing. What was done is added to `DOCS_TEST_LOG`.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

TICKS = 500  # the loop asks every so many ticks whether a run shall end
DRAWS = 2
FILES = 2  # of `scenarios/*.yaml`
DELAYS = ["--delay", "0", "--delay", "20"]
MOMENTS = {"--from": 0.1, "--time": 0.45, "--at": 0.45, "--to": 0.45}  # [s] the latest that a shortened run has
PARSED = {"screenshot", "interact", "--view", "--view-at", ".mp4"}  # a window, drawn for a minute; an optional package


def mode() -> str:
    """That of the block whose command this is."""
    return os.environ.get("DOCS_TEST_MODE", "short")


def end_runs_early() -> None:
    """Every run in this process ends as soon as the loop asks; worker processes import this file and do the same."""
    from wbmpc.checks.fall import FallWatch

    FallWatch.__call__ = lambda self: "shortened by the test of the documents"  # type: ignore[method-assign]


def run_wbmpc(arguments: list[str]) -> int:
    """The command line, or with mode parse its parser alone."""
    from typer.main import get_command

    from wbmpc.cli import app, main

    if mode() == "parse" or PARSED & {Path(word).suffix or word for word in arguments}:
        group = get_command(app)
        group.commands[arguments[0]].make_context(arguments[0], arguments[1:])
        return note("parsed", ["wbmpc", *arguments])
    if mode() == "short":
        end_runs_early()
        arguments = shortened(arguments)
    note("ran", ["wbmpc", *arguments])
    sys.argv = ["wbmpc", *arguments]
    try:
        main()
    except SystemExit as end:
        # What makes runs takes `--set`: when they are shortened, checks fail.
        return 0 if mode() == "short" and end.code == 1 and "--set" in options_of(arguments[0]) else int(end.code or 0)
    return 0


def options_of(name: str) -> set[str]:
    """The options of a command of ours; none when there is no such command."""
    from typer.main import get_command

    from wbmpc.cli import app

    command = get_command(app).commands.get(name)
    return {option for parameter in command.params for option in parameter.opts} if command else set()


def shortened(arguments: list[str]) -> list[str]:
    """In this process, with fewer files, draws and delays, and no moments later than a shortened run has."""
    options = options_of(arguments[0])
    files = [word for word in arguments if word.endswith(".yaml")]
    changed = [word for word in arguments if word not in files[FILES:]]
    for place, word in enumerate(changed[:-1]):
        if word == "--draws":
            changed[place + 1] = str(DRAWS)
        elif word in MOMENTS:
            changed[place + 1] = str(min(float(changed[place + 1]), MOMENTS[word]))
    if "--delay" in options and "--delay" not in changed:
        changed += DELAYS
    if "--jobs" in options and "--realtime" not in changed:
        changed += ["--jobs", "1"]  # the last one counts; every further process would import everything again
    return changed


def run_python(arguments: list[str]) -> int:
    """A module of the benchmarks is only looked up: they take minutes to hours; anything else runs."""
    if arguments[:1] == ["-m"] and arguments[1].split(".")[0] == "benchmarks":
        if importlib.util.find_spec(arguments[1]) is None:
            return 2
        return note("parsed", ["python", *arguments])
    note("ran", ["python", *arguments])
    return subprocess.call([sys.executable, *arguments])


def run_make(arguments: list[str]) -> int:
    """`make -n` in the repository: the target exists, its recipe is expanded. The commands of `make run` are run."""
    environment = os.environ | {"PATH": os.environ["PATH"].partition(":")[2]}  # the real one, not this file again
    command = ["make", "--no-print-directory", "-n", "-C", os.environ["DOCS_TEST_ROOT"], *arguments]
    made = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if made.returncode or arguments != ["run"]:
        note("parsed", ["make", *arguments])
        print(made.stderr, file=sys.stderr)
        return made.returncode
    (recipe,) = [line for line in made.stdout.splitlines() if line.startswith(".venv/bin/wbmpc ")]
    return subprocess.call(["bash", "-c", recipe])


def run_rerun(arguments: list[str]) -> int:
    """The viewer needs a screen: the recording exists, and the viewer is installed."""
    note("parsed", ["rerun", *arguments])
    installed = (Path(sys.executable).parent / "rerun").exists()
    return 0 if installed and all(Path(path).is_file() for path in arguments) else 2


def note(what: str, words: Sequence[str]) -> int:
    """Add a line to the log of what was done."""
    with Path(os.environ["DOCS_TEST_LOG"]).open("a", encoding="utf-8") as log:
        log.write(f"{what}\t{' '.join(words)}\n")
    return 0


def run_pytest(arguments: list[str]) -> int:
    """As written; scenarios as tests are only collected."""
    if "--wbmpc" in arguments:
        arguments = [*arguments, "--collect-only", "-n", "0"]
    return run_python(["-m", "pytest", *arguments])


PROGRAMS = {"wbmpc": run_wbmpc, "python": run_python, "make": run_make, "rerun": run_rerun, "pytest": run_pytest}


def main(name: str, arguments: list[str]) -> int:
    """The program of that name; `wbmpc` by the server that has everything imported, where there is one."""
    address = os.environ.get("DOCS_TEST_SERVER", "")
    if name == "wbmpc" and address:
        from warm import ask

        return ask(address, arguments)
    return PROGRAMS[name](arguments)


if __name__ == "__mp_main__" and mode() == "short":
    end_runs_early()
if __name__ == "__main__":
    sys.exit(main(os.environ["DOCS_TEST_PROGRAM"], sys.argv[1:]))
