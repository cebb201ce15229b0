"""Progress of long commands: a bar on a terminal; elsewhere nothing or, for logs, a line now and then.

Standard error only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from wbmpc.commands.exits import say


@contextmanager
def simulated_time(name: str, duration: float, *, log: bool = False) -> Iterator[Callable[[float], None]]:
    """Progress of one run; the callable takes the simulated time so far [s]. `log`: without a terminal, one line."""
    console = Console(stderr=True)
    if not console.is_terminal:
        if log:
            say(f"running {name} ({duration:g} s simulated)")
        yield lambda time: None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(name, total=duration)
        yield lambda time: progress.update(task, completed=time)


@contextmanager
def counted(name: str, total: int, done: int = 0, *, log: bool = False) -> Iterator[Callable[[str], None]]:
    """Progress of `total` items, `done` of them before the start; the callable takes a word on each finished item.

    `log`: without a terminal, a line for each item.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        count = done

        def line(word: str) -> None:
            nonlocal count
            count += 1
            if log:
                say(f"{name}: {count}/{total} {word}")

        yield line
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(name, total=total, completed=done)

        def advance(word: str) -> None:
            progress.update(task, advance=1, description=f"{name}: {word}")

        yield advance
