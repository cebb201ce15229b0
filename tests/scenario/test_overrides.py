"""`--set KEY=VALUE`, seeds and changed runs."""

from __future__ import annotations

import pickle

import pytest
from base_scenario import load, write

from wbmpc.errors import ScenarioError
from wbmpc.scenario import apply_overrides, counterfactual, load_scenario, parse_overrides, vary


def test_values_are_yaml():
    arguments = ["a=0.45", "b=true", "c=left", "d=[0.4, 0, 1e-1]", "e=null", "f=", "g=on", "h='3'", "i=x=y", "j={k: 1}"]
    assert parse_overrides(arguments) == {
        "a": 0.45,
        "b": True,
        "c": "left",
        "d": [0.4, 0, 0.1],
        "e": None,
        "f": None,
        "g": "on",
        "h": "3",
        "i": "x=y",
        "j": {"k": 1},
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["seed"], "--set seed: expected KEY=VALUE, such as seed=3"),
        (["=3"], "--set =3: expected KEY=VALUE, such as seed=3"),
        (["seed=3", "seed=4"], "--set seed: given twice"),
        (["seed=[1"], "--set seed: not valid YAML: expected ',' or ']', but got '<stream end>'"),
    ],
)
def test_malformed_arguments(arguments, message):
    with pytest.raises(ScenarioError) as raised:
        parse_overrides(arguments)
    assert str(raised.value) == message


def test_apply_overrides_changes_a_copy_only():
    document = {"tasks": [{"target": [1.0, 2.0]}], "plant": None, "bodies": {}}
    changed = apply_overrides(document, {"tasks.0.target.1": 5.0, "plant.friction": 0.4, "bodies.torso": 2.0})
    assert changed == {"tasks": [{"target": [1.0, 5.0]}], "plant": {"friction": 0.4}, "bodies": {"torso": 2.0}}
    assert document == {"tasks": [{"target": [1.0, 2.0]}], "plant": None, "bodies": {}}


def test_overrides_reach_values_and_absent_defaults(tmp_path):
    overrides = {
        "tasks.0.target.0": 0.45,
        "sensors.noise_scale": 1,  # `sensors` is not in the file
        "plant.friction": 0.4,
        "plant.body_mass_scale.arm": 1.2,
        "world.objects.table.size.2": 0.24,
    }
    scenario = load_scenario(write(tmp_path), overrides, seed=11)
    assert scenario.tasks[0].target == (0.45, 0.05, 0.3)
    assert scenario.sensors.noise_scale == 1.0
    assert scenario.plant.friction == 0.4
    assert scenario.plant.body_mass_scale == {"arm": 1.2}
    assert scenario.world.objects["table"].centre == (0.3, 0.0, 0.12)
    assert scenario.seed == 11
    untouched = load_scenario(write(tmp_path))
    assert untouched.tasks[0].target == (0.44, 0.05, 0.3)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"tasks.0.tarjet": 1.0}, "--set tasks.0.tarjet: unknown key, did you mean 'target'?"),
        ({"tsks.0.target": 1.0}, "--set tsks.0.target: unknown key 'tsks', did you mean 'tasks'?"),
        ({"tasks.1": {}}, "--set tasks.1: '1' is not an index in tasks, which has 1 item, counted from 0"),
        ({"tasks.-1": {}}, "--set tasks.-1: '-1' is not an index in tasks, which has 1 item, counted from 0"),
        ({"seed.x": 1}, "--set seed.x: seed is 3 and has no part 'x'"),
        ({"seed": True}, "--set seed: expected a whole number, got true"),
        ({"duration": float("nan")}, "--set duration: must be a finite number, got nan"),
        ({"duration": 5.0}, "--set duration: tasks.0: ends at 8.5 s, the run already at 5 s (duration)"),
        (
            {"world.floor": {"frction": 1.0}},
            "--set world.floor: world.floor.frction: unknown key, did you mean 'friction'?",
        ),
        ({"checks": []}, "--set checks: must have at least 1 item, got 0"),
        (
            {"world.objects.tabel.size.2": 0.2},
            "--set world.objects.tabel.size.2: unknown key 'tabel' in world.objects, did you mean 'table'?",
        ),
    ],
)
def test_mistakes_name_the_option(tmp_path, overrides, message):
    with pytest.raises(ScenarioError) as raised:
        load_scenario(write(tmp_path), overrides)
    assert str(raised.value) == message


def test_a_bad_seed_names_its_option(tmp_path):
    with pytest.raises(ScenarioError, match=r"^--seed: must be ≥ 0, got -1$"):
        load_scenario(write(tmp_path), seed=-1)


def test_counterfactual_is_the_changed_run(tmp_path):
    scenario = load(tmp_path)
    changed = counterfactual(scenario, "absent")
    assert scenario.world.objects["table"].present
    assert not changed.world.objects["table"].present
    assert changed.counterfactuals == {}
    assert changed.checks == scenario.checks
    assert changed.source == scenario.source


def test_vary_replaces_checks_and_refuses_the_invalid(tmp_path):
    scenario = load(tmp_path)
    assert vary(scenario, {"seed": 8}, checks=scenario.checks[:1]).checks == scenario.checks[:1]
    with pytest.raises(ScenarioError, match=r"^--set plant.mass_scale: must be > 0, got 0.0$"):
        vary(scenario, {"plant.mass_scale": 0.0})


def test_scenarios_and_errors_travel_between_processes(tmp_path):
    scenario = load(tmp_path)
    copy = pickle.loads(pickle.dumps(scenario))
    assert copy == scenario
    assert copy.source == scenario.source
    with pytest.raises(ScenarioError) as raised:
        vary(scenario, {"duration": -1.0})
    assert str(pickle.loads(pickle.dumps(raised.value))) == str(raised.value)
