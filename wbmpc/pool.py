"""Work in parallel processes that survives the death of one of them.

The standard pool gives up altogether when a worker dies, and does not say which item killed it. Here each worker holds
one item at a time, so that the item is known, and a fresh worker takes the dead one's place.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
from time import perf_counter
from typing import Any, Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

AWAKE = 0.05  # [s] to wake a core that sleeps takes up to a millisecond
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")  # variables that BLAS libraries read at their import


@dataclass(frozen=True, slots=True)
class Died:
    """What stands for the result of an item whose process ended without an answer."""

    reason: str  # "killed by SIGKILL (out of memory?)", "exit code 3"


def available_cores() -> int:
    """Cores that this process may use: fewer than the machine's where an affinity mask is set."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def one_thread_each() -> None:
    """One BLAS thread for what imports numpy after this, child processes included.

    The matrices are small: more threads only add jitter, and rounding that depends on the machine.
    """
    os.environ.update(dict.fromkeys(THREADS, "1"))


def finished(
    work: Callable[[Item], Result], items: Sequence[Item], *, jobs: int
) -> Generator[tuple[int, Result | Died], None, None]:
    """Index and result of every item, as they finish; begun in the given order, `jobs` at a time.

    With one job the items run in this process, where nobody can outlive a death. Ctrl-C reaches this process alone;
    the workers end with it, and with the iterator, which should be closed when it is not read to its end.

    Args:
        work: importable by name, since processes are spawned.

    Raises:
        Exception: what `work` raised, as soon as it did.
    """
    jobs = min(jobs, len(items))
    if jobs <= 1:
        yield from ((index, work(item)) for index, item in enumerate(items))
        return
    todo = list(enumerate(items))[::-1]
    busy: dict[Connection, Worker[Item, Result]] = {}
    try:
        for _ in range(jobs):
            worker = Worker(work, *todo.pop())
            busy[worker.connection] = worker
        while busy:
            for ready in wait(list(busy)):
                worker = busy[ready]  # type: ignore[index]
                index, result = worker.index, worker.result()
                if todo and not isinstance(result, Died):
                    worker.give(*todo.pop())
                else:
                    del busy[worker.connection]
                    worker.end()
                    if todo:
                        worker = Worker(work, *todo.pop())
                        busy[worker.connection] = worker
                yield index, result
    finally:
        for worker in busy.values():
            worker.end()


class Worker(Generic[Item, Result]):
    """One process and the item that it works on; what it is given next finds the process as the last item left it."""

    def __init__(self, work: Callable[[Item], Result], index: int, item: Item, *, awake: bool = False) -> None:
        """`awake`: between two items the process keeps its core busy for up to `AWAKE`."""
        # Spawned, not forked: solver libraries hold threads and locks that do not survive a fork.
        one_thread_each()
        context = get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, work, awake), daemon=True)
        # A terminal sends Ctrl-C to all. Blocked from birth in the child, it is for the parent to decide.
        # Python's resource tracker, which comes up with the first process, would unblock it again.
        resource_tracker.ensure_running()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        theirs.close()  # so that the end of the process is the end of the pipe
        self.give(index, item)

    def give(self, index: int, item: Item) -> None:
        self.index = index
        with suppress(BrokenPipeError):  # it died at once: `result` says so
            self.connection.send(item)

    def ready(self) -> bool:
        """Whether `result` need not wait."""
        return self.connection.poll(0.0)

    def result(self) -> Result | Died:
        try:
            error, value = self.connection.recv()
        except (EOFError, ConnectionResetError):
            self.process.join()
            return Died(_reason(self.process.exitcode or 0))
        if error is not None:
            raise error
        result: Result = value
        return result

    def end(self) -> None:
        self.process.terminate()
        self.process.join()
        self.connection.close()


def _serve(connection: Connection, work: Callable[[Any], Any], awake: bool) -> None:
    """The life of a worker process: an item in, its result or exception out, until the pipe ends."""
    with suppress(EOFError, BrokenPipeError):
        while True:
            sleep_at = perf_counter() + AWAKE if awake else 0.0
            while not connection.poll(0.0) and perf_counter() < sleep_at:
                pass
            item = connection.recv()
            answer, failure = None, None
            try:
                answer = work(item)
            except Exception as error:
                failure = error
            connection.send((failure, answer))


def _reason(code: int) -> str:
    if code >= 0:
        return f"its process ended with exit code {code}"
    name = signal.Signals(-code).name
    return f"its process was killed by {name}{' (out of memory?)' if name == 'SIGKILL' else ''}"
