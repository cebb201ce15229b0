"""What stands for work in the tests of the pool: importable by name and light, since processes are spawned."""

from __future__ import annotations

import os
import signal
import time
from typing import Any

from wbmpc.errors import WbmpcError


def squared(item: int) -> tuple[int, dict[str, str]]:
    """The square, and what the process sees of the thread settings. Item 4 takes long."""
    time.sleep(0.5 if item == 4 else 0.0)
    return item * item, {name: os.environ.get(name, "") for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}


def killed(item: int) -> int:
    """Odd items take their process with them, -1 more quietly."""
    if item == -1:
        os._exit(7)
    if item % 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def interrupted(item: int) -> int:
    """Ctrl-C reaches every process of the terminal."""
    os.kill(os.getpid(), signal.SIGINT)
    return item


def raising(item: int) -> int:
    """Bad input, on item 1."""
    if item == 1:
        raise WbmpcError("no such robot")
    time.sleep(0.2)
    return item


def dying_run(job: Any) -> Any:
    """A run whose process dies when the robot weighs twice as much."""
    if job.scenario.plant.mass_scale == 2.0:
        os.kill(os.getpid(), signal.SIGKILL)
    from wbmpc.commands.exits import ExitCode
    from wbmpc.commands.one_run import Outcome
    from wbmpc.junit import Suite

    return Outcome(ExitCode.PASSED, f"PASS {job.name}", Suite(job.name, 0.1, []))
