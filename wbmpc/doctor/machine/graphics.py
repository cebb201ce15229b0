"""Off-screen OpenGL for pictures, a display and a viewer for recordings."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from wbmpc.doctor.check import Answer
from wbmpc.doctor.machine.software import environment_at_start

PATIENCE = 60.0  # [s] for one OpenGL
OFF_SCREEN = ("egl", "osmesa")  # what `wbmpc render` tries, in this order
# In a process of its own: MuJoCo chooses once, and a broken driver may take the process with it.
_PICTURE = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
with mujoco.Renderer(model, 16, 16) as renderer:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer.update_scene(data)
    renderer.render()
    from OpenGL.GL import GL_RENDERER, glGetString
    print(glGetString(GL_RENDERER).decode())
"""


def opengl(_: None = None) -> Answer:
    """Which OpenGL draws a MuJoCo picture here, by trying."""
    backends = [*OFF_SCREEN, *(["glfw"] if os.environ.get("DISPLAY") else [])]
    tried = {backend: _start(backend) for backend in backends}
    return judged(
        {backend: _end(process) for backend, process in tried.items()}, environment_at_start().get("MUJOCO_GL", "")
    )


def judged(tried: dict[str, tuple[bool, str]], chosen: str) -> Answer:
    """Of backend -> (works, renderer or reason), with the user's MUJOCO_GL, empty if there is none."""
    words = [f"{name}: {text}" for name, (works, text) in tried.items() if works]
    refused = [f"{name}: {text}" for name, (works, text) in tried.items() if not works]
    if chosen in tried and not tried[chosen][0]:
        return Answer("", (), [f"MUJOCO_GL={chosen} does not work here: {tried[chosen][1]}", *words])
    if not any(tried[name][0] for name in OFF_SCREEN if name in tried):
        return Answer("", (), [f"no pictures without a screen: {'; '.join(refused)}"])
    return Answer("; ".join(words))


def display(_: None = None) -> Answer:
    """A screen, for the viewer."""
    found = [f"{name}={os.environ[name]}" for name in ("DISPLAY", "WAYLAND_DISPLAY") if os.environ.get(name)]
    if found or sys.platform != "linux":
        return Answer(", ".join(found) or "the system's own")
    return Answer("none: recordings open elsewhere, or in a browser with `rerun --web-viewer`")


def viewer(_: None = None) -> Answer:
    """The rerun viewer of this environment."""
    path = shutil.which("rerun", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
    if path is None:
        return Answer("", (), ["no command `rerun`: recordings cannot be looked at here"])
    done = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=PATIENCE, check=False)
    words = " ".join(done.stdout.split()[:2])
    return Answer(words, (), [f"`rerun --version` ends with {done.returncode}"] if done.returncode else [])


def _start(backend: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "MUJOCO_GL": backend, "PYOPENGL_PLATFORM": "" if backend == "glfw" else backend}
    command = [sys.executable, "-c", _PICTURE]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def _end(process: subprocess.Popen[str]) -> tuple[bool, str]:
    """Whether a picture came, and of what renderer; or why not."""
    try:
        output, errors = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return False, f"no answer within {PATIENCE:g} s"
    if process.returncode == 0:
        return True, (output.splitlines() or ["works"])[-1]
    raised = [
        line for line in errors.splitlines() if line and not line.startswith((" ", "Exception ignored", "Traceback"))
    ]
    return False, (raised or [f"exit code {process.returncode}"])[0]
