"""All checks of the machine."""

from __future__ import annotations

from collections.abc import Callable

from wbmpc.doctor.check import Check, Finding, examine
from wbmpc.doctor.machine import cores, graphics, software

CHECKS: tuple[Check[None], ...] = (
    Check("python", software.python, "make PYTHON=python3.11 clean setup"),
    Check("packages", software.packages, "make setup, which installs the pinned versions of requirements/"),
    Check("threads", software.threads, "unset them, or set them to 1: more threads add jitter and other rounding"),
    Check("hot loops", software.kernels, "python -m wbmpc.warm_up"),
    Check("disk", software.disk, "make room, or run with --no-record"),
    Check(
        "opengl", graphics.opengl, "on Debian: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri; only for pictures"
    ),
    Check("display", graphics.display, "only the viewer needs one; `wbmpc render` and `wbmpc plot` draw without"),
    Check("viewer", graphics.viewer, "make setup; it comes with rerun-sdk"),
    Check("cores", cores.cores, "run in lockstep, which any machine can; real-time runs want four cores"),
    Check(
        "load", cores.load, "end what else runs, pin the virtual machine's cores; lockstep results do not depend on it"
    ),
    Check("clock", cores.frequency, "cpupower frequency-set --governor performance, for real-time runs"),
    Check(
        "priority",
        cores.priority,
        "'@GROUP - rtprio 20' in /etc/security/limits.d/, then log in again; real-time runs only",
    ),
    Check("punctuality", cores.punctuality, "real-time runs only: grant the priority, or take a PREEMPT_RT kernel"),
)


def examine_machine(on_done: Callable[[str], None] | None = None) -> list[Finding]:
    """The finding of every check; takes a few seconds, most of them to try OpenGL."""
    return examine(CHECKS, None, on_done)
