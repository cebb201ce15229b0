"""A window that nobody sees: it keeps the frames and gives back what a script says."""

from __future__ import annotations

from collections.abc import Callable

from wbmpc.interact.exchange import Frame, Inputs


class FakeWindow:
    """`script` is asked at every frame, with the frame's number, what the person does then."""

    def __init__(self, script: Callable[[int], Inputs | None] = lambda k: Inputs()) -> None:
        self.frames: list[Frame] = []
        self._script = script

    def exchange(self, frame: Frame) -> Inputs | None:
        self.frames.append(frame)
        return self._script(len(self.frames) - 1)

    def close(self) -> None:
        pass
