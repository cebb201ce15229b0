"""`wbmpc replay`: the run of a recording once more, in lockstep, and whether it is the same to the bit."""

from __future__ import annotations

from pathlib import Path

from wbmpc.commands.exits import ExitCode, say
from wbmpc.commands.progress import simulated_time
from wbmpc.replay import open_run
from wbmpc.replay import replay as run_again


def replay(path: Path, *, robot: Path | None) -> ExitCode:
    """Replay the recording and print both hashes; exit code 1 when one bit of one tick differs.

    Raises:
        WbmpcError: it is no recording, holds no schedule or no tick, or its run cannot be made by this program.
    """
    recorded = open_run(path, robot=robot)
    ticks, step = recorded.run.schedule.ticks, recorded.scenario.loop.timestep
    if not recorded.whole:
        say(f"{path}: ends at {ticks * step:g} of {recorded.scenario.duration:g} s; replaying that")
    with simulated_time(f"{recorded.name} again", ticks * step) as on_progress:
        again = run_again(recorded, on_progress)
    loop = "threaded" if recorded.realtime else "lockstep"
    print(f"recorded  {recorded.run.state_sha256}  ({loop}, {ticks} ticks, {len(recorded.run.schedule.effects)} plans)")
    print(f"replayed  {again.state_sha256}")
    if again.first_difference is None:
        print("same", flush=True)
        return ExitCode.PASSED
    note = "" if recorded.same_source else "; the program's source is not the one that made the recording"
    print(f"differs at tick {again.first_difference} ({again.first_difference * step:.3f} s){note}", flush=True)
    return ExitCode.FAILED
