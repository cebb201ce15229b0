"""How far a scenario goes: the first value of one key at which its checks fail.

    python -m benchmarks.limits [NAME ...]

Each limit walks away from the scenario's own value until a run fails, in steps that double, then bisects between the
last value that passed and the first that failed down to the limit's resolution. Runs are in lockstep and not
recorded; the verdict is that of `wbmpc run FILE --set KEY=VALUE`. Between the values tried nothing is known: the
outcome need not be monotone.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from wbmpc.scenario import load_scenario, parse_overrides
from wbmpc.session import run_scenario

SCENARIOS = Path(__file__).parents[1] / "scenarios"
MOST_STEPS = 6  # doublings without a failure after which the walk stops

# The pushes of push_stand one at a time, in a run that is just long enough.
ONE_PUSH = "disturbances=[{kind: impulse, body: torso, time: 0.5, duration: 0.1, impulse: [%s]}]"
SHORT = "duration=6"
ANY_PUSH = "checks.0.min_impulse=0.01"  # the scenario asks for a push of a certain strength

# walk, one command or one push at a time.
ONE_COMMAND = "tasks.0.commands=[{time: 0.5, velocity: [%s], yaw_rate: %s}, {time: 5.0, velocity: [0.0, 0.0]}]"
UPRIGHT = ("duration=7.5", "checks=[{kind: upright_at_end}]", "counterfactuals={}", "sweep=null")
ONLY_WALK = (*UPRIGHT, "disturbances=[]")
WALK_PUSH = (*UPRIGHT, ONE_COMMAND % ("0.125, 0.0", "0.0"))
PUSHED = "disturbances=[{kind: impulse, body: torso, time: 2.6, duration: 0.1, impulse: [%s]}]"


@dataclass(frozen=True)
class Limit:
    """One walk: `setting` is a KEY=VALUE with %s where the value goes."""

    scenario: str
    setting: str
    unit: str
    start: float  # passes
    step: float  # first step, its sign is the direction
    resolution: float
    fixed: tuple[str, ...] = ()

    def arguments(self, value: float) -> list[str]:
        """The KEY=VALUE arguments of one run."""
        return [*self.fixed, self.setting % f"{value:.6g}"]


LIMITS = {
    "push_forward": Limit("push_stand", ONE_PUSH % "%s, 0.0, 0.0", "N·s", 1.4, 0.1, 0.05, (SHORT,)),
    "push_backward": Limit("push_stand", ONE_PUSH % "%s, 0.0, 0.0", "N·s", -0.6, -0.2, 0.05, (SHORT, ANY_PUSH)),
    "push_left": Limit("push_stand", ONE_PUSH % "0.0, %s, 0.0", "N·s", 1.4, 0.1, 0.05, (SHORT,)),
    "push_rail": Limit(
        "push_wall", "disturbances.0.impulse=[0.0, %s, 0.0]", "N·s", 2.88, 0.1, 0.1, ("checks.0.min_impulse=0.01",)
    ),
    "reach_x": Limit("reach", "tasks.0.target.0=%s", "m", 0.44, 0.02, 0.01),
    "reach_high": Limit("reach", "tasks.0.target.2=%s", "m", 0.30, 0.06, 0.02),
    "reach_low": Limit("reach", "tasks.0.target.2=%s", "m", 0.30, -0.05, 0.02),
    "table_low": Limit("reach", "world.objects.table.size.2=%s", "m", 0.20, -0.04, 0.01),
    "table_high": Limit("reach", "world.objects.table.size.2=%s", "m", 0.20, 0.04, 0.01),
    "mass_light": Limit("reach", "plant.mass_scale=%s", "1", 1.0, -0.1, 0.05),
    "mass_heavy": Limit("reach", "plant.mass_scale=%s", "1", 1.0, 0.1, 0.05),
    "walk_forward": Limit("walk", ONE_COMMAND % ("%s, 0.0", "0.0"), "m/s", 0.22, 0.02, 0.02, ONLY_WALK),
    "walk_backward": Limit("walk", ONE_COMMAND % ("%s, 0.0", "0.0"), "m/s", -0.18, -0.02, 0.02, ONLY_WALK),
    "walk_left": Limit("walk", ONE_COMMAND % ("0.0, %s", "0.0"), "m/s", 0.04, 0.01, 0.01, ONLY_WALK),
    "walk_turn": Limit("walk", ONE_COMMAND % ("0.0, 0.0", "%s"), "rad/s", 0.3, 0.2, 0.1, ONLY_WALK),
    "walk_push_forward": Limit("walk", PUSHED % "%s, 0.0, 0.0", "N·s", 1.5, 0.2, 0.1, WALK_PUSH),
    "walk_push_left": Limit("walk", PUSHED % "0.0, %s, 0.0", "N·s", 0.5, 0.2, 0.1, WALK_PUSH),
    "wide_step_width": Limit("wide_step", "tasks.0.target.1=%s", "m", 0.225, 0.01, 0.005),
    "wide_step_wall": Limit("wide_step", "world.objects.wall.position.1=%s", "m", 0.33, 0.01, 0.005),
    "wide_step_mass": Limit("wide_step", "plant.mass_scale=%s", "1", 1.0, 0.1, 0.05),
    "hole_sill_depth": Limit("hole", "world.objects.sill.size.0=%s", "m", 0.09, 0.01, 0.005),
    "hole_sill_height": Limit("hole", "world.objects.sill.size.2=%s", "m", 0.03, 0.01, 0.005),
    "hole_mass": Limit("hole", "plant.mass_scale=%s", "1", 1.0, 0.1, 0.05),
    "two_hands_lean": Limit("two_hands", "tasks.0.target.0=%s", "m", 0.12, 0.005, 0.005),
    "two_hands_mass": Limit("two_hands", "plant.mass_scale=%s", "1", 1.0, 0.1, 0.05),
    "lift_mass": Limit("box_lift", "world.objects.box.mass=%s", "kg", 0.5, 0.1, 0.05),
    "lift_low": Limit("box_lift", "world.objects.box.size.2=%s", "m", 0.12, -0.01, 0.005),
    "lift_far": Limit("box_lift", "world.objects.box.position.0=%s", "m", 0.16, 0.01, 0.005),
    "stairs_rise": Limit("stairs", "world.staircase.rise=%s", "m", 0.03, 0.004, 0.004),
    "uneven_told": Limit("uneven", "world.tiles.highest=%s", "m", 0.03, 0.01, 0.005),
    "carry_mass": Limit("box_stairs", "world.objects.box.mass=%s", "kg", 0.3, 0.1, 0.1),
    "carry_rise": Limit("box_stairs", "world.staircase.rise=%s", "m", 0.02, 0.005, 0.005),
    "friction_low": Limit("reach", "plant.friction=%s", "1", 0.8, -0.2, 0.05),
}


def failing(limit: Limit, value: float) -> tuple[str, ...]:
    """Names of the checks that fail at `value`; empty when all pass."""
    path = SCENARIOS / f"{limit.scenario}.yaml"
    scenario = load_scenario(path, parse_overrides(limit.arguments(value)))
    return run_scenario(scenario, name=limit.scenario).verdict.failing


def search(limit: Limit, say: Console) -> tuple[float, float | None, tuple[str, ...]]:
    """The last value that passed, the first that failed (None: none did), and what failed there.

    Raises:
        RuntimeError: the start fails already.
    """

    def judge(value: float) -> tuple[str, ...]:
        failed = failing(limit, value)
        say.print(f"  {value:.4g} {limit.unit}: {', '.join(failed) or 'pass'}")
        return failed

    good, step = limit.start, limit.step
    if failed := judge(good):
        raise RuntimeError(f"the start {good:g} fails already: {', '.join(failed)}")
    for _ in range(MOST_STEPS):
        bad = good + step
        if failed := judge(bad):
            break
        good, step = bad, 2.0 * step
    else:
        return good, None, ()
    while abs(bad - good) > 1.5 * limit.resolution:
        middle = limit.resolution * round((good + bad) / 2.0 / limit.resolution)
        if here := judge(middle):
            bad, failed = middle, here
        else:
            good = middle
    return good, bad, failed


def main() -> int:
    """Search the limits named on the command line, all of them by default."""
    parser = argparse.ArgumentParser(description="How far the scenarios go.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(LIMITS)} [all]")
    names = parser.parse_args().names or list(LIMITS)
    if unknown := [name for name in names if name not in LIMITS]:
        print(f"no such limit: {', '.join(unknown)} (choices: {', '.join(LIMITS)})", file=sys.stderr)
        return 2
    console = Console()
    table = Table(title="last value that passes, first that fails", title_justify="left")
    for header in ("limit", "passes", "fails", "unit", "failed checks"):
        table.add_column(header)
    for name in names:
        console.print(f"{name}: {LIMITS[name].scenario} {LIMITS[name].setting}", markup=False)
        try:
            good, bad, failed = search(LIMITS[name], console)
        except RuntimeError as error:
            console.print(f"  {error}")
            continue
        table.add_row(
            name, f"{good:.4g}", "none" if bad is None else f"{bad:.4g}", LIMITS[name].unit, ", ".join(failed)
        )
    console.print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
