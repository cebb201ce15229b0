"""Pictures of a recording in the real viewer, without a screen: rerun's headless viewer, asked over its protocol."""

from __future__ import annotations

import io
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, TypeVar

import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

from wbmpc.errors import WbmpcError
from wbmpc.rerun_sink.reading import Recording, whole_messages
from wbmpc.rerun_sink.stream import TIMELINE

_PATIENCE = 90.0  # [s] for the viewer to start, and for a recording to be there: drawing in software is slow
_LAST_WORDS = 10.0  # [s] for a viewer that fails to end
_POLL = 0.3  # [s]
_MOST_PICTURES = 40  # until two are alike
_TITLE_OF = "display_name"
T = TypeVar("T")


class Viewer:
    """One recording in one headless viewer; made by `headless_viewer`."""

    def __init__(self, client: Any, alive: Callable[[], None], path: Path) -> None:
        """Show `path` and wait until it is loaded; `alive` raises when the viewer has ended."""
        self._client, self._alive, self._path = client, alive, path
        with whole_messages(path) as whole:  # the viewer waits for ever for the rest of one that was cut short
            client.open(str(whole.resolve()))
            self._recording = self._patiently(self._loaded)
        # What says nothing of the run takes no room: the bar above with its warnings.
        self._change(
            lambda blueprint: blueprint.setdefault("/top_panel", {}).update(PanelBlueprint={"state": "Hidden"})
        )

    def show_tab(self, name: str) -> None:
        """Bring the tab of that name to the front.

        Raises:
            WbmpcError: there is none; the choices.
        """
        blueprint = self._client.get_blueprint(of="recording").blueprint
        titles = {
            entity.strip("/"): fields[_TITLE_OF]
            for entity, archetypes in blueprint.items()
            for fields in archetypes.values()
            if _TITLE_OF in fields
        }
        for entity, archetypes in blueprint.items():
            container = archetypes.get("ContainerBlueprint", {})
            if container.get("container_kind") == "Tabs":
                tabs = {titles[member]: member for member in container["contents"] if member in titles}
                if name not in tabs:
                    raise WbmpcError(f"{self._path}: no tab {name!r}; choose one of {', '.join(tabs)}")
                self._change(lambda b: b[entity]["ContainerBlueprint"].update(active_tab=tabs[name]))  # noqa: B023
                return
        raise WbmpcError(f"{self._path}: it opens without tabs")

    def go_to(self, moment: float) -> None:
        """Stop at `moment` [s].

        Raises:
            WbmpcError: it is outside the run.
        """
        (timeline,) = (t for t in self._recording.timelines if t.name == TIMELINE)
        first, last = 1e-9 * timeline.start, 1e-9 * timeline.end
        if not first <= moment <= last:
            raise WbmpcError(f"{self._path}: no {moment:g} s: the run goes from {first:g} to {last:g} s")
        self._client.set_time(TIMELINE, duration=moment, play_state="paused")

    def picture(self, title: str | None = None) -> Image.Image:
        """The whole window, or the view of that title alone, once two pictures in a row are alike.

        Raises:
            WbmpcError: there is no such view; the choices.
        """
        view_id = None
        if title is not None:
            views = {view.name: view.view_id for view in self._client.get_state().views}
            if title not in views:
                raise WbmpcError(f"{self._path}: no view {title!r}; choose one of {', '.join(sorted(views))}")
            view_id = views[title]
        before = b""
        for _ in range(_MOST_PICTURES):
            time.sleep(_POLL)
            content = self._client.take_screenshot(view_id)
            if content == before:
                break
            before = content
        image = Image.open(io.BytesIO(content)).convert("RGB")
        return image if view_id else image.crop((0, _empty_rows(image), *image.size))

    def _loaded(self) -> Any | None:
        state = self._client.get_state()
        here = [r for r in state.recordings if r.store_id == state.active_recording and r.timelines]
        return here[0] if here and not state.loading and state.views else None

    def _patiently(self, ask: Callable[[], T | None]) -> T:
        return _patiently(ask, self._alive, f"rerun's viewer did not load {self._path} within {_PATIENCE:g} s")

    def _change(self, edit: Callable[[dict[str, Any]], object]) -> None:
        blueprint = self._client.get_blueprint(of="recording").blueprint
        edit(blueprint)
        self._client.set_blueprint(blueprint, of="recording")


@contextmanager
def headless_viewer(path: Path, *, width: int, height: int) -> Iterator[Viewer]:
    """A viewer of `width` by `height` [px] with the recording `path` open; ended with the context.

    Raises:
        WbmpcError: no recording of this project, or the viewer does not start (it needs Vulkan, in software if need be)
            or does not load the file.
    """
    Recording(path)  # the viewer would not say what is wrong with it
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with TemporaryFile() as log:
        process = subprocess.Popen(
            _command(width, height, port),
            stdout=log,
            stderr=log,
            start_new_session=True,  # the command is a shim that starts the viewer: both end together
            env={**os.environ, "RERUN_APP_ONLY": "true"},  # asks no questions, sends nothing home
        )

        def alive() -> None:
            if process.poll() is not None:
                log.seek(0)
                raise WbmpcError(_why_it_ended(log.read().decode(errors="replace")))

        try:
            late = f"rerun's viewer did not answer within {_PATIENCE:g} s"
            client = _patiently(lambda: _connected(port), alive, late)
            yield Viewer(client, alive, path)
        except ConnectionError as error:  # without graphics it answers once, and ends
            with suppress(subprocess.TimeoutExpired):
                process.wait(timeout=_LAST_WORDS)
            alive()
            raise WbmpcError(f"rerun's viewer does not answer: {str(error).splitlines()[0]}") from error
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)
            process.wait()


def _command(width: int, height: int, port: int) -> list[str]:
    options = {"--window-size": f"{width}x{height}", "--bind": "127.0.0.1", "--port": str(port)}
    flags = ["--headless", "--hide-welcome-screen"]
    # Not `-m rerun`, which cannot be imported with the variable that is set for it.
    return [sys.executable, "-m", "rerun_cli", *flags, *(word for option in options.items() for word in option)]


def _empty_rows(image: Image.Image) -> int:
    """Rows [px] at the top of the window where the hidden bar was, its frame included."""
    frame = 4  # [px]
    brightest = np.asarray(image.convert("L"))[frame:, frame:-frame].max(axis=1)
    return frame + int(np.argmax(brightest > brightest[0]))


def _patiently(ask: Callable[[], T | None], alive: Callable[[], None], late: str) -> T:
    """The first answer that is not None, asked again and again."""
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        alive()
        if (answer := ask()) is not None:
            return answer
        time.sleep(_POLL)
    raise WbmpcError(late)


def _connected(port: int) -> Any | None:
    try:
        client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        client.get_state()
    except (ConnectionError, RuntimeError):
        return None
    return client


def _why_it_ended(text: str) -> str:
    if "adapter" in text or "render context" in text:
        return (
            "rerun's viewer found no graphics: install a Vulkan driver, one that draws in software will do "
            "(Debian: mesa-vulkan-drivers, libvulkan1)"
        )
    lines = [line.strip() for line in text.splitlines() if line.strip()] or ["it said nothing"]
    panic = [line for line in lines if "panicked" in line]
    return f"rerun's viewer ended at its start: {(panic or lines[-1:])[0]}"
