"""`wbmpc report`: one HTML page about runs."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path

import wbmpc.render  # noqa: F401  # first of all: it chooses MuJoCo's off-screen OpenGL before mujoco is imported
from wbmpc.commands.exits import ExitCode, say
from wbmpc.errors import WbmpcError
from wbmpc.pool import Died, available_cores, finished
from wbmpc.report.find import Unreadable, find_runs
from wbmpc.report.page import page
from wbmpc.report.run import Run, judged, read_run


def report(paths: Sequence[Path], target: Path | None, *, animation: bool, title: str, jobs: int | None) -> ExitCode:
    """Write the page; what cannot be read is said there and on standard error.

    Raises:
        WbmpcError: a path that does not exist, not one run that can be read, or the page cannot be written.
    """
    sources, unreadable = find_runs(paths)
    found: dict[int, Run] = {}
    read = partial(read_run, animation=animation)
    for done, (index, result) in enumerate(finished(read, sources, jobs=jobs or available_cores()), 1):
        source = sources[index]
        say(f"{done}/{len(sources)} {source.folder / source.name}")
        if isinstance(result, Died):
            unreadable.append(Unreadable(source.folder / source.name, result.reason))
            continue
        run, faults = result
        unreadable += faults
        if run is not None:
            found[index] = run
    runs = [found[index] for index in sorted(found)]
    for file in unreadable:
        say(f"{file.path}: {file.reason}")
    if not runs:
        raise WbmpcError(
            f"no run in {', '.join(map(str, paths))}: a run is a recording (.rrd), a verdict (.json) or both"
        )
    if target is None:
        target = (paths[0] if paths[0].is_dir() else paths[0].parent) / "report.html"
    text = page(judged(runs), unreadable, title=title, made=datetime.now())
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
    except OSError as error:
        raise WbmpcError(f"cannot write the report {target}: {error.strerror or error}") from error
    print(f"{target}: {len(runs)} run{'s' if len(runs) != 1 else ''}, {len(text) / 1e6:.1f} MB")
    return ExitCode.PASSED
