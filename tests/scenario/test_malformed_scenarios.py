"""Malformed files: one clear line each, at the place where a text editor finds the mistake."""

from __future__ import annotations

import re

import pytest
from base_scenario import BASE, edited, write
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wbmpc.errors import ScenarioError
from wbmpc.scenario import load_scenario


def second_task(task: str) -> str:
    """The base text with one more task in flow style."""
    return edited("disturbances:", f"  - {task}\ndisturbances:")


def staircase(values: str) -> str:
    """The base text with a staircase in which some keys are others."""
    keys = dict(position="[1.0, 0.0]", steps="3", rise="0.02", depth="0.2", landing="0.3", width="0.5")
    keys |= dict(item.split(": ") for item in values.split("; "))
    block = ", ".join(f"{key}: {value}" for key, value in keys.items())
    return edited("patches:\n", f"  staircase: {{{block}}}\npatches:\n")


def after_a_lift(task: str) -> str:
    """The base text with a lift of a crate and then another task."""
    crate = "    crate: {kind: box, size: [0.1, 0.1, 0.1], position: [0.2, 0.0], mass: 0.2}\n"
    text = second_task("{kind: lift, object: crate, height: 0.1, start: 8.6, reach_time: 1.0, raise_time: 1.0}")
    return text.replace("patches:", f"{crate}patches:", 1).replace("disturbances:", f"  - {task}\ndisturbances:", 1)


def tiles(values: str, others: str = "count: [3, 2], size: [0.2, 0.2], lowest: 0.01, highest: 0.03") -> str:
    """The base text with a field of tiles in which one key is another; `others` are the keys left as they are."""
    return edited("patches:\n", f"  tiles: {{position: [1.0, 0.0], {others}, {values}}}\npatches:\n")


# (what is wrong, text, the part of the text where the problem must point, message)
MISTAKES = [
    (
        "unknown key",
        edited("yaw: 0.0, friction", "yaw: 0.0, frction"),
        "frction",
        "world.objects.table.frction: unknown key, did you mean 'friction'?",
    ),
    (
        "mistyped required key",
        edited("target:", "tarjet:"),
        "tarjet",
        "tasks.0.tarjet: unknown key, did you mean 'target'?",
    ),
    ("missing key", edited("duration: 12.0\n", ""), "name", "duration: required key is missing"),
    ("wrong type", edited("duration: 12.0", "duration: '12'"), "'12'", "duration: expected a number, got '12'"),
    (
        "boolean for a number",
        edited("hold: 2.0\n", "hold: true\n"),
        "true",
        "tasks.0.hold: expected a number, got true",
    ),
    ("fraction for an integer", edited("seed: 3", "seed: 3.0"), "3.0", "seed: expected a whole number, got 3.0"),
    ("YAML 1.1 boolean", edited("seed: 3", "seed: on"), "on\n", "seed: expected a whole number, got 'on'"),
    ("YAML 1.1 base 60", edited("duration: 12.0", "duration: 0:12"), "0:12", "duration: expected a number, got '0:12'"),
    ("negative mass", edited("mass_scale: 1.0", "mass_scale: -1.0"), "-1.0", "plant.mass_scale: must be > 0, got -1.0"),
    ("NaN", edited("start: 0.5", "start: .nan"), ".nan", "tasks.0.start: must be a finite number, got nan"),
    (
        "infinity",
        edited("[0.44, 0.05, 0.3]", "[0.44, -.inf, 0.3]"),
        "-.inf",
        "tasks.0.target.1: must be a finite number, got -inf",
    ),
    ("overflow", edited("start: 0.5", "start: 1e999"), "1e999", "tasks.0.start: must be a finite number, got inf"),
    (
        "wrong length",
        edited("[0.44, 0.05, 0.3]", "[0.44, 0.05]"),
        "[0.44, 0.05]",
        "tasks.0.target: expected 3 items, got 2",
    ),
    (
        "too many items",
        edited("position: [0.3, 0.0]", "position: [0.3, 0.0, 0.1]"),
        "[0.3, 0.0, 0.1]",
        "world.objects.table.position: expected 2 items, got 3",
    ),
    (
        "unknown kind",
        edited("kind: reach\n", "kind: raech\n"),
        "raech",
        "tasks.0.kind: unknown kind 'raech', did you mean 'reach'?",
    ),
    (
        "unknown choice",
        edited("face: top", "face: topp"),
        "topp",
        "patches.right.face: expected 'top', 'bottom', 'front', 'back', 'left' or 'right', "
        "got 'topp', did you mean 'top'?",
    ),
    (
        "unsafe name",
        edited("name: base", "name: ../base"),
        "../base",
        "name: '../base' is not a valid name: letters, digits, '_' and '-' only, at most 64, "
        "beginning with a letter or digit",
    ),
    ("duplicate key", edited("seed: 3", "seed: 3\nseed: 4"), "seed: 4", "seed: duplicate key, first on line 3"),
    (
        "recursive alias",
        edited("initial: {keyframe: home, joints: {elbow: 0.1}}", "initial: &a {joints: {elbow: *a}}"),
        "elbow: *a",
        "initial.joints.elbow: recursive reference, the alias contains itself",
    ),
    ("undefined alias", edited("seed: 3", "seed: *b"), "*b", "not valid YAML: found undefined alias 'b'"),
    ("merge key", edited("seed: 3", "<<: {seed: 3}"), "<<", "<<: merge keys are not supported"),
    ("foreign tag", edited("seed: 3", "seed: !!python/name:os 3"), "!!python", "seed: unknown tag !!python/name:os"),
    ("key that is a number", edited("seed: 3", "3: 3"), "3: 3", "a key must be text, got 3"),
    (
        "syntax",
        edited("mass_scale: 1.0}", "mass_scale: 1.0"),
        ": {physics",
        "not valid YAML: expected ',' or '}', but got ':'",
    ),
    (
        "unreachable horizon",
        edited("mass_scale: 1.0}", "mass_scale: 1.0}\nplanner: {horizon_steps: 64, horizon_step: 0.5}"),
        "64",
        "planner.horizon_steps: the horizon of 32 s is longer than the run of 12 s",
    ),
    (
        "arrives before it starts",
        edited("arrive_by: 4.0", "arrive_by: 0.4"),
        "0.4\n",
        "tasks.0.arrive_by: must be later than start (0.5 s), got 0.4 s",
    ),
    (
        "task outlives the run",
        edited("hold: 2.0\n", "hold: 8.0\n"),
        "kind: reach\n",
        "tasks.0: ends at 14.5 s, the run already at 12 s (duration)",
    ),
    (
        "leans while it reaches",
        second_task("{kind: lean, target: [0.1, 0.0], start: 6.0, arrive_by: 7.0}"),
        "{kind: lean",
        "tasks.1: begins at 6 s, but tasks.0 (reach) lasts until 8.5 s",
    ),
    (
        "leans before it starts",
        second_task("{kind: lean, target: [0.1, 0.0], start: 9.0, arrive_by: 8.6, hold: 0.1}"),
        "8.6",
        "tasks.1.arrive_by: must be later than start (9 s), got 8.6 s",
    ),
    (
        "walks too fast",
        second_task("{kind: walk, commands: [{time: 1.0, velocity: [0.25, -0.25]}]}"),
        "[0.25, -0.25]",
        "tasks.1.commands.0.velocity: too fast: 0.353553 m/s, at most 0.3 m/s",
    ),
    (
        "turns too fast",
        second_task("{kind: walk, commands: [{time: 1.0, velocity: [0.1, 0.0], yaw_rate: -1.5}]}"),
        "-1.5",
        "tasks.1.commands.0.yaw_rate: must be ≥ -1, got -1.5",
    ),
    (
        "walks without a command",
        second_task("{kind: walk, commands: []}"),
        "[]",
        "tasks.1.commands: must have at least 1 item, got 0",
    ),
    (
        "walking commands out of order",
        second_task("{kind: walk, commands: [{time: 2.5, velocity: [0.1, 0.0]}, {time: 2.5, velocity: [0.0, 0.0]}]}"),
        "2.5, velocity: [0.0",
        "tasks.1.commands.1.time: must be later than the command before it (2.5 s), got 2.5 s",
    ),
    (
        "walks after the end",
        second_task("{kind: walk, commands: [{time: 12.5, velocity: [0.1, 0.0]}]}"),
        "{kind: walk",
        "tasks.1: ends at 12.5 s, the run already at 12 s (duration)",
    ),
    (
        "steps with a hand",
        second_task("{kind: step, foot: auto, target: [0.1, 0.05]}"),
        "auto",
        "tasks.1.foot: expected 'left' or 'right', got 'auto'",
    ),
    (
        "steps at a place in space",
        second_task("{kind: step, foot: left, target: [0.1, 0.05, 0.0]}"),
        "[0.1, 0.05, 0.0]",
        "tasks.1.target: expected 2 items, got 3",
    ),
    (
        "swings for no time",
        second_task("{kind: step, foot: left, target: [0.1, 0.05], duration: 0.0}"),
        "0.0}\ndist",
        "tasks.1.duration: must be > 0, got 0.0",
    ),
    (
        "steps after the end",
        second_task("{kind: step, foot: left, target: [0.1, 0.05], start: 11.0}"),
        "{kind: step",
        "tasks.1: ends at 13 s, the run already at 12 s (duration)",
    ),
    (
        "steps with both feet at once",
        second_task("{kind: step, foot: left, target: [0.1, 0.05], start: 2.0}").replace(
            "disturbances:", "  - {kind: step, foot: right, target: [0.1, -0.05], start: 3.5}\ndisturbances:"
        ),
        "{kind: step, foot: right",
        "tasks.2: begins at 3.5 s, but tasks.1 (step) moves the feet until 4 s",
    ),
    (
        "goes while it walks",
        second_task("{kind: go, target: [1.0, 0.0], start: 5.0}").replace(
            "disturbances:", "  - {kind: walk, commands: [{time: 1.0, velocity: [0.1, 0.0]}]}\ndisturbances:"
        ),
        "{kind: go",
        "tasks.1: begins at 5 s, but tasks.2 (walk) moves the feet until the run ends",
    ),
    (
        "steps longer than the longest",
        second_task("{kind: go, target: [1.0, 0.0], step_length: 0.1, longest_step: 0.09}"),
        "0.09",
        "tasks.1.longest_step: must not be less than step_length (0.1 m), got 0.09 m",
    ),
    (
        "push after the end",
        edited("time: 2.0", "time: 12.0"),
        "12.0, dur",
        "disturbances.0.time: ends at 12.1 s, the run already at 12 s (duration)",
    ),
    (
        "non-divisible rates",
        edited("planner_rate: 100", "planner_rate: 130"),
        "130",
        "loop.planner_rate: 130 Hz does not divide loop.physics_rate (1000 Hz)",
    ),
    (
        "delay between two ticks",
        edited("planner_delay: 0.01", "planner_delay: 0.0105"),
        "0.0105",
        "loop.planner_delay: 0.0105 s is not a whole number of physics steps (1/1000 s)",
    ),
    (
        "empty checks",
        edited(
            "checks:\n  - {kind: reach, max: 0.01, hold: 2.0}\n  - {kind: contact_patches, allowed: [right]}",
            "checks: []",
        ),
        "[]",
        "checks: must have at least 1 item, got 0",
    ),
    (
        "same check twice",
        edited("{kind: contact_patches, allowed: [right]}", "{kind: reach, max: 0.1, hold: 2.0}"),
        "reach, max: 0.1,",
        "checks.1.kind: a second check called 'reach', give it a name of its own (key 'name')",
    ),
    (
        "patch on nothing",
        edited("{on: table", "{on: tabel"),
        "tabel",
        "patches.right.on: no object 'tabel', did you mean 'table'?",
    ),
    (
        "patch off its face",
        edited("[0.04, -0.1]", "[0.14, -0.1]"),
        "0.14",
        "patches.right.offset.0: off the face: 0.14 m from the centre, the face ends at 0.1 m",
    ),
    (
        "check names a patch",
        edited("allowed: [right]", "allowed: [rigt]"),
        "rigt",
        "checks.1.allowed.0: no patch 'rigt', did you mean 'right'?",
    ),
    (
        "check of a task that is not there",
        edited("{kind: contact_patches, allowed: [right]}", "{kind: arrived, tolerance: 0.03}"),
        "arrived",
        "checks.1.kind: needs a go task or a target",
    ),
    (
        "check of the other foot",
        second_task("{kind: step, foot: left, target: [0.1, 0.05]}").replace(
            "{kind: contact_patches, allowed: [right]}", "{kind: foot_moved, foot: right, tolerance: 0.03}"
        ),
        "foot_moved",
        "checks.1.kind: needs a step task of the right foot or a target",
    ),
    (
        "window after the end",
        edited("{kind: contact_patches, allowed: [right]}", "{kind: footsteps, min_count: 1, window: [2.0, 12.5]}"),
        "[2.0, 12.5]",
        "checks.1.window: ends at 12.5 s, the run already at 12 s (duration)",
    ),
    (
        "window backwards",
        edited("{kind: contact_patches, allowed: [right]}", "{kind: footsteps, min_count: 1, window: [2.0, 1.5]}"),
        "{kind: footsteps",
        "checks.1: 'window' needs its beginning first, got [2, 1.5]",
    ),
    (
        "travels nowhere in particular",
        edited("{kind: contact_patches, allowed: [right]}", "{kind: travelled, window: [1.0, 2.0]}"),
        "{kind: travelled",
        "checks.1: needs at least one of 'forward', 'left' and 'turned'",
    ),
    (
        "range upside down",
        edited("{kind: contact_patches, allowed: [right]}", "{kind: travelled, forward: [0.6, 0.5]}"),
        "{kind: travelled",
        "checks.1: 'forward' needs its lower bound first, got [0.6, 0.5]",
    ),
    (
        "unknown robot",
        edited("robot: tiny.xml", "robot: tin.xml"),
        "tin.xml",
        "robot: no such file: 'tin.xml' relative to the scenario's directory",
    ),
    (
        "unknown joint",
        edited("elbow: 0.1", "elbo: 0.1"),
        "elbo:",
        "initial.joints.elbo: no joint 'elbo', did you mean 'elbow'?",
    ),
    (
        "unknown body",
        edited("body: torso", "body: trso"),
        "trso",
        "disturbances.0.body: no body 'trso', did you mean 'torso'?",
    ),
    (
        "unknown keyframe",
        edited("keyframe: home", "keyframe: hom"),
        "hom,",
        "initial.keyframe: no keyframe 'hom', did you mean 'home'?",
    ),
    (
        "object named as a robot geom",
        BASE.replace("table", "foot"),
        "foot:",
        "world.objects.foot: the robot has a geom of this name",
    ),
    (
        "counterfactual of nothing",
        edited("table.present", "tabel.present"),
        "world.objects.tabel.present",
        "counterfactuals.absent.set.world.objects.tabel.present: "
        "unknown key 'tabel' in world.objects, did you mean 'table'?",
    ),
    (
        "counterfactual with a bad value",
        edited("present: false", "present: 0"),
        "0}\n    expect",
        "counterfactuals.absent.set.world.objects.table.present: expected true or false, got 0",
    ),
    (
        "counterfactual fails an unknown check",
        edited("failing: [reach]", "failing: [raech]"),
        "raech",
        "counterfactuals.absent.failing.0: no check 'raech', did you mean 'reach'?",
    ),
    (
        "varies nothing",
        edited("key: tasks.0.target.0", "key: tasks.0.tarjet"),
        "tasks.0.tarjet",
        "sweep.variations.0.key: unknown key, did you mean 'target'?",
    ),
    (
        "varies beyond a list",
        edited("key: tasks.0.target.0", "key: tasks.1.target"),
        "tasks.1.target",
        "sweep.variations.0.key: '1' is not an index in tasks, which has 1 item, counted from 0",
    ),
    (
        "varies into the invalid",
        edited("key: tasks.0.target.0, uniform: [0.42, 0.46]", "key: tasks.0.start, uniform: [0.4, 4.5]"),
        "[0.4, 4.5]",
        "sweep.variations.0.uniform: tasks.0.arrive_by: must be later than start (4.5 s), got 4 s",
    ),
    (
        "no distribution",
        edited(", uniform: [0.42, 0.46]", ""),
        "{key: ",
        "sweep.variations.0: needs exactly one of 'uniform' and 'choice'",
    ),
    (
        "empty range",
        edited("[0.42, 0.46]", "[0.46, 0.42]"),
        "{key: ",
        "sweep.variations.0: 'uniform' needs its lower bound first, got [0.46, 0.42]",
    ),
    ("YAML 1.1 directive", "%YAML 1.1\n---\n" + BASE, "%YAML", "YAML 1.2 only, remove the %YAML directive"),
    ("two documents", BASE + "---\na: 1\n", "---", "not valid YAML: found another document"),
    ("a list", "- 1\n", "- 1", "expected a mapping of scenario keys, got a list"),
    ("empty", "", "", "the file is empty, expected a mapping of scenario keys"),
    (
        "lifted object",
        second_task("{kind: lift, object: tabel, height: 0.1, start: 9.0, reach_time: 1.0, raise_time: 1.0}"),
        "tabel",
        "tasks.1.object: no object 'tabel', did you mean 'table'?",
    ),
    (
        "fixed object lifted",
        second_task("{kind: lift, object: table, height: 0.1, start: 9.0, reach_time: 1.0, raise_time: 1.0}"),
        "table, height",
        "tasks.1.object: 'table' is fixed, give it a mass (world.objects.table.mass)",
    ),
    (
        "brace on what gives way",
        edited("friction: 0.9}", "friction: 0.9, mass: 0.5}"),
        "table, face",
        "patches.right.on: 'table' has a mass, it gives way: no hand can brace on it",
    ),
    (
        "hands taken",
        second_task("{kind: lift, object: crate, height: 0.1, start: 7.0}").replace(
            "patches:", "    crate: {kind: box, size: [0.1, 0.1, 0.1], position: [0.2, 0.0], mass: 0.2}\npatches:", 1
        ),
        "kind: reach",
        "tasks.0: ends at 8.5 s, but tasks.1 (lift) takes both hands from 7 s on",
    ),
    (
        "lift with a walk",
        after_a_lift("{kind: walk, commands: [{time: 9.0, velocity: [0.1, 0.0]}]}"),
        "{kind: walk",
        "tasks.2: the hands cannot carry in a walk, use go after tasks.1 (lift)",
    ),
    (
        "steps before the lift",
        after_a_lift("{kind: go, target: [1.0, 0.0], start: 8.0}"),
        "{kind: go",
        "tasks.2: begins at 8 s, but tasks.1 (lift) is where the feet are, at 8.6 s",
    ),
    (
        "lift with a height of its own",
        after_a_lift("{kind: com_height, waypoints: [{time: 1.0, height: 0.25}]}"),
        "{kind: com_height",
        "tasks.2: tasks.1 (lift) has a CoM height of its own",
    ),
    (
        "ground that gives way",
        edited("friction: 0.9}", "friction: 0.9, walkable: true}").replace(
            "patches:",
            "    crate: {kind: box, size: [0.1, 0.1, 0.1], position: [0.2, 0.0], mass: 0.2, walkable: true}\npatches:",
            1,
        ),
        "true}\npatches",
        "world.objects.crate.walkable: 'crate' has a mass, it gives way: no foot can stand on it",
    ),
    (
        "tiles upside down",
        tiles("highest: 0.03", "count: [3, 2], size: [0.2, 0.2], lowest: 0.04"),
        "0.03}",
        "world.tiles.highest: must not be less than lowest (0.04 m), got 0.03 m",
    ),
    (
        "tiles as low as the floor",
        tiles("lowest: 0.0", "count: [3, 2], size: [0.2, 0.2], highest: 0.04"),
        "0.0}",
        "world.tiles.lowest: must be > 0, got 0.0",
    ),
    (
        "half a tile",
        tiles("count: [3, 2.5]", "size: [0.2, 0.2], lowest: 0.01, highest: 0.03"),
        "2.5",
        "world.tiles.count.1: expected a whole number, got 2.5",
    ),
    (
        "more tiles than anyone counts",
        tiles("count: [51, 2]", "size: [0.2, 0.2], lowest: 0.01, highest: 0.03"),
        "51",
        "world.tiles.count.0: must be ≤ 50, got 51",
    ),
    (
        "tiles without their size",
        tiles("friction: 0.5", "count: [3, 2], lowest: 0.01, highest: 0.03"),
        "tiles",
        "world.tiles.size: required key is missing",
    ),
    (
        "unknown key of the tiles",
        tiles("frction: 0.5"),
        "frction",
        "world.tiles.frction: unknown key, did you mean 'friction'?",
    ),
    (
        "object named as a tile",
        tiles("friction: 0.5").replace("table", "tile_2_1"),
        "tile_2_1:",
        "world.objects.tile_2_1: the name 'tile_2_1' is taken by one of world.tiles",
    ),
    (
        "tiles wanted as patches",
        tiles("friction: 0.5").replace("on: table", "on: tile_0_0"),
        "tile_0_0, face",
        "patches.right.on: no object 'tile_0_0', choices: table",
    ),
    (
        "ground error of nothing less than everything",
        edited("mass_scale: 1.0", "ground_error: 0.06"),
        "0.06",
        "plant.ground_error: must be ≤ 0.05, got 0.06",
    ),
    (
        "negative ground error",
        edited("mass_scale: 1.0", "ground_error: -0.004"),
        "-0.004",
        "plant.ground_error: must be ≥ 0, got -0.004",
    ),
    (
        "tiles may vanish",
        tiles("friction: 0.5").replace("mass_scale: 1.0", "ground_error: 0.01"),
        "0.01}\nloop",
        "plant.ground_error: must be less than the height of the lowest walkable object (the lowest tile, 0.01 m), "
        "got 0.01 m",
    ),
    (
        "a step may vanish",
        edited("size: [0.2, 0.6, 0.2]", "walkable: true, size: [0.2, 0.6, 0.03]").replace(
            "mass_scale: 1.0", "ground_error: 0.04"
        ),
        "0.04}\nloop",
        "plant.ground_error: must be less than the height of the lowest walkable object (table, 0.03 m), got 0.04 m",
    ),
    (
        "a staircase without steps",
        staircase("steps: 0"),
        "0, rise",
        "world.staircase.steps: must be ≥ 1, got 0",
    ),
    (
        "a staircase that goes down at once",
        staircase("rise: -0.02"),
        "-0.02",
        "world.staircase.rise: must be > 0, got -0.02",
    ),
    (
        "an object called like a tread",
        staircase("rise: 0.03").replace("table", "tread_4"),
        "tread_4",
        "world.objects.tread_4: the name 'tread_4' is taken by one of world.staircase",
    ),
    (
        "treads may vanish",
        staircase("rise: 0.03").replace("mass_scale: 1.0", "ground_error: 0.03"),
        "0.03}\nloop",
        "plant.ground_error: must be less than the height of the lowest walkable object (the lowest tread, 0.03 m), "
        "got 0.03 m",
    ),
    (
        "weightless",
        edited("friction: 0.9}", "friction: 0.9, mass: 0.0}"),
        "0.0}",
        "world.objects.table.mass: must be > 0, got 0.0",
    ),
]


@pytest.mark.parametrize(("text", "where", "message"), [row[1:] for row in MISTAKES], ids=[row[0] for row in MISTAKES])
def test_one_located_line(tmp_path, text, where, message):
    path = write(tmp_path, text)
    with pytest.raises(ScenarioError) as raised:
        load_scenario(path)
    index = text.index(where)
    line, column = text.count("\n", 0, index) + 1, index - (text.rfind("\n", 0, index) + 1) + 1
    assert str(raised.value) == f"{path}:{line}:{column}: {message}"
    excerpt = raised.value.problems[0].excerpt
    if text:
        source, caret = excerpt.split("\n")
        assert source == text.splitlines()[line - 1]
        assert caret == " " * (column - 1) + "^"
    assert raised.value.exit_code == 2


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"seed: 1\n# " + b"x" * 300_000, "{path}: is too large for a scenario: 300 kB, at most 200 kB"),
        (b"seed: 1\n\x00\x01", "{path}:2:1: not a text file (NUL byte)"),
        (b"seed: 1\nname: caf\xe9\n", "{path}:2:10: not a UTF-8 text file (byte 0xe9)"),
        (b"\x89PNG\r\n\x1a\n", "{path}:1:1: not a UTF-8 text file (byte 0x89)"),
        (b"seed: \x07\n", "{path}:1:7: character not allowed: #x0007"),
        (b"a: " + b"[" * 2000, "{path}:1:1: nested too deeply"),
    ],
    ids=["huge", "NUL", "latin-1", "png", "control character", "deep"],
)
def test_files_that_are_no_text(tmp_path, content, line):
    path = write(tmp_path, content)
    with pytest.raises(ScenarioError) as raised:
        load_scenario(path)
    assert str(raised.value) == line.format(path=path)


def test_paths_that_are_no_file(tmp_path):
    write(tmp_path, name="reach.yaml")
    for name, message in [("", "is a directory"), ("raech.yaml", "no such file, did you mean 'reach.yaml'?")]:
        with pytest.raises(ScenarioError, match=re.escape(message)):
            load_scenario(tmp_path / name)


def test_aliases_cannot_explode(tmp_path):
    levels = "".join(f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * 9)}]\n" for i in range(1, 9))
    with pytest.raises(ScenarioError, match="more than 20000 values"):
        load_scenario(write(tmp_path, "l0: &l0 [1]\n" + levels))


def test_every_mistake_is_reported_in_the_order_of_the_file(tmp_path):
    text = (
        BASE.replace("friction: 0.9", "frction: 0.9")
        .replace("hold: 2.0\n", "hold: -2.0\n")
        .replace("seed: 3", "sed: 3")
    )
    with pytest.raises(ScenarioError) as raised:
        load_scenario(write(tmp_path, text))
    lines = [int(problem.place.split(":")[-2]) for problem in raised.value.problems]
    assert lines == [3, 9, 17]


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_text_is_read_or_refused_in_single_lines(tmp_path, data):
    """Whatever a slip of the hand makes of a file, there is a scenario or a ScenarioError; never another exception."""
    start = data.draw(st.integers(0, len(BASE) - 1))
    length = data.draw(st.integers(0, 12))
    text = data.draw(st.text(st.sampled_from("[]{}:,-*&!|>'\"#%@`? \n\t0.eé\x85"), max_size=6))
    problems = _problems(write(tmp_path, BASE[:start] + text + BASE[start + length :]))
    assert all(problem.isprintable() for problem in problems)


def _problems(path):
    try:
        load_scenario(path)
    except ScenarioError as error:
        assert error.problems  # noqa: PT017 - the property is about whatever is raised, if anything is
        return [str(problem) for problem in error.problems]
    return []


def test_feet_may_be_asked_for_one_thing_after_another(tmp_path):
    tasks = """\
  - {kind: go, target: [1.0, 0.0], start: 9.0}
  - {kind: step, foot: left, target: [0.1, 0.05], start: 3.0}
  - {kind: step, foot: right, target: [0.1, -0.05], start: 5.0}
  - {kind: walk, commands: [{time: 1.0, velocity: [0.1, 0.0]}, {time: 3.0, velocity: [0.0, 0.0]}]}
"""
    assert len(load_scenario(write(tmp_path, edited("disturbances:", tasks + "disturbances:"))).tasks) == 5
