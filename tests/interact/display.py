"""A virtual display for tests that open a window."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def virtual_display() -> Iterator[dict[str, str]]:
    """The environment of a process that draws on a display that nobody sees; skips the test where there is no Xvfb."""
    program = shutil.which("Xvfb")
    if program is None:
        pytest.skip("no Xvfb here")
    read, write = os.pipe()
    command = [program, "-displayfd", str(write), "-screen", "0", "480x300x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as pipe:
            number = pipe.readline().strip()
        if not number:
            pytest.skip("Xvfb does not start here")
        environment = {**os.environ, "DISPLAY": f":{number}", "LIBGL_ALWAYS_SOFTWARE": "1", "LP_NUM_THREADS": "1"}
        for name in ("WAYLAND_DISPLAY", "MUJOCO_GL", "PYOPENGL_PLATFORM"):
            environment.pop(name, None)
        yield environment
    finally:
        server.terminate()
        server.wait()
