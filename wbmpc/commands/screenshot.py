"""`wbmpc screenshot`: a recording as the viewer shows it, without a screen."""

from __future__ import annotations

from pathlib import Path

from wbmpc.commands.exits import ExitCode
from wbmpc.errors import WbmpcError
from wbmpc.files import prepare, writing
from wbmpc.rerun_sink.viewer import headless_viewer

FORMATS = (".png", ".webp")


def screenshot(
    recording: Path, target: Path, *, moment: float | None, tab: str | None, view: str | None, size: tuple[int, int]
) -> ExitCode:
    """Save what the viewer shows of `recording` at `moment` [s] (None: where it opens) into `target`.

    Raises:
        WbmpcError: no such recording, tab, view or time, an unknown suffix, or no viewer.
    """
    suffix = target.suffix.lower()
    if suffix not in FORMATS:
        raise WbmpcError(f"{target}: unknown kind of picture; choose one of {', '.join(FORMATS)}")
    prepare(target)
    width, height = size
    with headless_viewer(recording, width=width, height=height) as viewer:
        if tab is not None:
            viewer.show_tab(tab)
        if moment is not None:
            viewer.go_to(moment)
        picture = viewer.picture(view)
    with writing(target):
        picture.save(target, **({"quality": 85, "method": 6} if suffix == ".webp" else {"optimize": True}))
    print(target)
    return ExitCode.PASSED
