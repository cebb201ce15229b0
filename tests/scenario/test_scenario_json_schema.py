"""The JSON Schema that editors use: valid itself, complete, and of one mind with the loader."""

from __future__ import annotations

from pathlib import Path

import jsonschema
import pytest
from base_scenario import BASE, edited
from ruamel.yaml import YAML

from wbmpc.scenario import load_scenario, scenario_json_schema

SHIPPED = sorted((Path(__file__).parents[2] / "scenarios").glob("*.yaml"))
SCHEMA = scenario_json_schema()


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_scenarios_are_valid_for_loader_and_schema(path):
    assert load_scenario(path).name == path.stem
    jsonschema.Draft202012Validator(SCHEMA).validate(YAML(typ="safe").load(path))


def test_there_are_shipped_scenarios():
    assert {"stand", "squat", "push_stand", "reach"} <= {path.stem for path in SHIPPED}


def test_schema_is_a_valid_schema():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize(
    "text",
    [
        edited("yaw: 0.0", "jaw: 0.0"),
        edited("mass_scale: 1.0", "mass_scale: -1.0"),
        edited("kind: reach\n", "kind: reech\n"),
        edited("[0.44, 0.05, 0.3]", "[0.44, 0.05]"),
        edited("duration: 12.0\n", ""),
        edited("seed: 3", "seed: on"),
    ],
)
def test_schema_refuses_what_the_loader_refuses(text):
    validator = jsonschema.Draft202012Validator(SCHEMA)
    assert validator.is_valid(YAML(typ="safe").load(BASE))
    assert not validator.is_valid(YAML(typ="safe").load(text))


def test_every_key_of_the_scenario_blocks_is_described():
    """Blocks of wbmpc/scenario; those of planner, tracker and checks are described where they are defined."""
    missing = [
        f"{title}.{key}"
        for title, definition in [("Scenario", SCHEMA), *SCHEMA["$defs"].items()]
        for key, value in definition.get("properties", {}).items()
        if "description" not in value and title in OWN_BLOCKS
    ]
    assert not missing


OWN_BLOCKS = {
    "Scenario",
    "InitialState",
    "World",
    "Floor",
    "Box",
    "Tiles",
    "Staircase",
    "Patch",
    "StandTask",
    "ComHeightTask",
    "HeightWaypoint",
    "LeanTask",
    "ReachTask",
    "WalkTask",
    "VelocityCommand",
    "StepTask",
    "GoTask",
    "LiftTask",
    "Impulse",
    "PlantSettings",
    "SensorSettings",
    "LoopSettings",
    "RecordingSettings",
    "Counterfactual",
    "Variation",
    "Sweep",
}


def test_own_blocks_are_in_the_schema():
    assert set(SCHEMA["$defs"]) >= OWN_BLOCKS - {"Scenario"}
