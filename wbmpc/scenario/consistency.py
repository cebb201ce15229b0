"""What no single field can say: names that must exist, times that must fit, rates that must divide."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from wbmpc.checks.settings import (
    Arrived,
    ContactPatches,
    FootMoved,
    Reach,
    ScenarioCheck,
    UniversalSettings,
    WindowSettings,
)
from wbmpc.scenario.boxes import made_names
from wbmpc.scenario.diagnosis import Finding
from wbmpc.scenario.ground_consistency import find_ground_inconsistencies
from wbmpc.scenario.patches import FACES
from wbmpc.scenario.robot_file import RobotNames
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.tasks import GoTask, LiftTask, ReachTask, StepTask, Task
from wbmpc.scenario.task_consistency import find_task_inconsistencies
from wbmpc.scenario.wording import KeyPath, describe, near_misses

FLOOR = "floor"


def find_inconsistencies(scenario: Scenario) -> list[Finding]:
    """Every contradiction between the fields of one scenario; counterfactuals and sweep are looked at elsewhere."""
    return [
        *_objects_and_patches(scenario),
        *_lifted_objects(scenario),
        *find_ground_inconsistencies(scenario),
        *_times(scenario),
        *find_task_inconsistencies(scenario),
        *_rates(scenario),
        *_checks(scenario),
    ]


def find_unknown_names(scenario: Scenario, robot: RobotNames) -> Iterator[Finding]:
    """Every name that the robot model does not have, or that it has already."""
    yield from _must_exist(("initial", "keyframe"), scenario.initial.keyframe, robot.keyframes, "keyframe")
    for joint in scenario.initial.joints:
        yield from _must_exist(("initial", "joints", joint), joint, robot.joints, "joint", at_key=True)
    movable = [name for name, box in scenario.world.objects.items() if box.mass is not None]
    for body in scenario.plant.body_mass_scale:
        yield from _must_exist(("plant", "body_mass_scale", body), body, [*robot.bodies, *movable], "body", at_key=True)
    for index, disturbance in enumerate(scenario.disturbances):
        yield from _must_exist(("disturbances", index, "body"), disturbance.body, robot.bodies, "body")
    for name in scenario.world.objects:
        if name in robot.geoms:
            yield Finding(("world", "objects", name), "the robot has a geom of this name", at_key=True)
        elif name in movable and name in robot.bodies:
            yield Finding(("world", "objects", name), "the robot has a body of this name", at_key=True)
    for name, key in made_names(scenario.world).items():
        if name in robot.geoms:
            yield Finding(("world", key), f"the robot has a geom called '{name}'", at_key=True)


def check_names(scenario: Scenario) -> tuple[str, ...]:
    """Names of all checks of a run as results show them: the universal ones, then the scenario's own."""
    return (*UniversalSettings.model_fields, *(check.name or check.kind for check in scenario.checks))


def _must_exist(
    path: KeyPath, name: str, choices: Iterable[str], what: str, *, at_key: bool = False
) -> Iterator[Finding]:
    choices = list(choices)
    if name not in choices:
        yield Finding(path, f"no {what} {describe(name)}" + near_misses(name, choices), at_key)


def _objects_and_patches(scenario: Scenario) -> Iterator[Finding]:
    objects = scenario.world.objects
    if FLOOR in objects:
        yield Finding(("world", "objects", FLOOR), "the name 'floor' is taken by the floor itself", at_key=True)
    for name, patch in scenario.patches.items():
        path: KeyPath = ("patches", name)
        if patch.on not in objects:
            yield from _must_exist((*path, "on"), patch.on, objects, "object")
            continue
        for component, axis in enumerate(FACES[patch.face].plane_axes):
            half = objects[patch.on].size[axis] / 2
            if abs(patch.offset[component]) > half:
                yield Finding(
                    (*path, "offset", component),
                    f"off the face: {patch.offset[component]:g} m from the centre, the face ends at {half:g} m",
                )


def _lifted_objects(scenario: Scenario) -> Iterator[Finding]:
    objects = scenario.world.objects
    for index, task in enumerate(scenario.tasks):
        if not isinstance(task, LiftTask):
            continue
        path: KeyPath = ("tasks", index, "object")
        if task.object not in objects:
            yield from _must_exist(path, task.object, objects, "object")
        elif objects[task.object].mass is None:
            yield Finding(path, f"'{task.object}' is fixed, give it a mass (world.objects.{task.object}.mass)")
    for name, box in objects.items():
        if box.walkable and box.mass is not None:
            yield Finding(
                ("world", "objects", name, "walkable"), f"'{name}' has a mass, it gives way: no foot can stand on it"
            )
    for name, patch in scenario.patches.items():
        if patch.on in objects and objects[patch.on].mass is not None:
            yield Finding(("patches", name, "on"), f"'{patch.on}' has a mass, it gives way: no hand can brace on it")


def _times(scenario: Scenario) -> Iterator[Finding]:
    horizon = scenario.planner.horizon_steps * scenario.planner.horizon_step
    if horizon > scenario.duration:
        message = f"the horizon of {horizon:g} s is longer than the run of {scenario.duration:g} s"
        yield Finding(("planner", "horizon_steps"), message)
    for index, disturbance in enumerate(scenario.disturbances):
        if disturbance.end > scenario.duration:
            message = f"ends at {disturbance.end:g} s, the run already at {scenario.duration:g} s (duration)"
            yield Finding(("disturbances", index, "time"), message)


def _rates(scenario: Scenario) -> Iterator[Finding]:
    loop = scenario.loop
    rates: list[tuple[KeyPath, int]] = [
        (("loop", "planner_rate"), loop.planner_rate),
        (("recording", "rate"), scenario.recording.rate),
    ]
    for path, rate in rates:
        if loop.physics_rate % rate:
            yield Finding(path, f"{rate} Hz does not divide loop.physics_rate ({loop.physics_rate} Hz)")
    times: list[tuple[KeyPath, float]] = [
        (("loop", "planner_delay"), loop.planner_delay),
        (("duration",), scenario.duration),
    ]
    for path, time in times:
        ticks = time * loop.physics_rate
        if not math.isclose(ticks, round(ticks), rel_tol=1e-9, abs_tol=1e-9):
            yield Finding(path, f"{time:g} s is not a whole number of physics steps (1/{loop.physics_rate} s)")
    horizon = scenario.planner.horizon_steps * scenario.planner.horizon_step
    if horizon < loop.planner_delay + 1 / loop.planner_rate:
        message = f"the horizon of {horizon:g} s ends before the next plan can take effect"
        yield Finding(("planner", "horizon_steps"), message)


def _checks(scenario: Scenario) -> Iterator[Finding]:
    names = check_names(scenario)
    universal = len(names) - len(scenario.checks)
    for index, check in enumerate(scenario.checks):
        path: KeyPath = ("checks", index)
        name = names[universal + index]
        if name in names[: universal + index]:
            key = "name" if check.name else "kind"
            yield Finding((*path, key), f"a second check called '{name}', give it a name of its own (key 'name')")
        yield from _target(path, check, scenario.tasks)
        if isinstance(check, WindowSettings) and check.window is not None and check.window[1] > scenario.duration:
            message = f"ends at {check.window[1]:g} s, the run already at {scenario.duration:g} s (duration)"
            yield Finding((*path, "window"), message)
        if isinstance(check, ContactPatches):
            for position, patch in enumerate(check.allowed or ()):
                yield from _must_exist((*path, "allowed", position), patch, scenario.patches, "patch")
            if check.max_count is not None and check.max_count < check.min_count:
                yield Finding((*path, "max_count"), f"less than min_count ({describe(check.min_count)})")


def _target(path: KeyPath, check: ScenarioCheck, tasks: Iterable[Task]) -> Iterator[Finding]:
    """A check without a target of its own takes that of a task, which must then be there."""
    if isinstance(check, Reach):
        what, has_target = "a reach task", any(isinstance(task, ReachTask) for task in tasks)
    elif isinstance(check, Arrived):
        what, has_target = "a go task", any(isinstance(task, GoTask) for task in tasks)
    elif isinstance(check, FootMoved):
        what = f"a step task of the {check.foot} foot"
        has_target = any(isinstance(task, StepTask) and task.foot == check.foot for task in tasks)
    else:
        return
    if check.target is None and not has_target:
        yield Finding((*path, "kind"), f"needs {what} or a target")
