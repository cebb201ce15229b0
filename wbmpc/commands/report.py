"""`wbmpc report`: one HTML page about runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path

import wbmpc.render  # noqa: F401  # first of all: it chooses MuJoCo's off-screen OpenGL before mujoco is imported
from wbmpc.commands.exits import ExitCode, say
from wbmpc.commands.progress import counted
from wbmpc.errors import WbmpcError
from wbmpc.files import prepare, writing
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
    if target is None:
        target = (paths[0] if paths[0].is_dir() else paths[0].parent) / "report.html"
    prepare(target)
    found: dict[int, Run] = {}
    read = partial(read_run, animation=animation)
    with counted("report", len(sources)) as advance:
        for index, result in finished(read, sources, jobs=jobs or available_cores()):
            source = sources[index]
            advance(source.name)
            if isinstance(result, Died):
                unreadable.append(Unreadable(source.folder / source.name, result.reason))
                continue
            run, faults = result
            unreadable += faults
            if run is not None:
                found[index] = run
    runs = [found[index] for index in sorted(found)]
    lines = [f"{file.path}: {file.reason}" for file in unreadable]
    if not runs:
        nothing = f"no run in {', '.join(map(str, paths))}: a run is a recording (.rrd), a verdict (.json) or both"
        raise WbmpcError("\n".join(lines) or nothing)
    undrawn = Counter(run.undrawn for run in runs if run.undrawn)
    for line in (*lines, *(f"no pictures of {count} of {len(runs)} runs: {why}" for why, count in undrawn.items())):
        say(line)
    text = page(judged(runs), unreadable, title=title, made=datetime.now())
    with writing(target):
        target.write_text(text, encoding="utf-8")
    print(f"{target}: {len(runs)} run{'s' if len(runs) != 1 else ''}, {len(text) / 1e6:.1f} MB")
    return ExitCode.PASSED
