"""Scenarios: YAML files -> typed, strict, located settings -> the MuJoCo world of a run."""

from wbmpc.scenario.boxes import all_boxes, ground_boxes
from wbmpc.scenario.consistency import check_names
from wbmpc.scenario.ground import Tread, resolve_ground
from wbmpc.scenario.json_schema import scenario_json_schema
from wbmpc.scenario.load import counterfactual, load_scenario, robot_path, vary
from wbmpc.scenario.loads import Load, resolve_loads
from wbmpc.scenario.obstacles import Obstacle, resolve_obstacles
from wbmpc.scenario.overrides import apply_overrides, parse_overrides
from wbmpc.scenario.patches import PatchPose, resolve_patches
from wbmpc.scenario.schema.experiments import Counterfactual, Sweep, Variation
from wbmpc.scenario.schema.loop import InitialState, LoopSettings, RecordingSettings
from wbmpc.scenario.schema.plant import Disturbance, Impulse, PlantSettings, SensorSettings
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.tasks import (
    ComHeightTask,
    ExcursionTask,
    GoTask,
    HeightWaypoint,
    LeanTask,
    LiftTask,
    ReachTask,
    StandTask,
    StepTask,
    Task,
    VelocityCommand,
    WalkTask,
)
from wbmpc.scenario.schema.world import Box, Floor, Patch, Staircase, Tiles, World
from wbmpc.scenario.world import build_world

__all__ = [
    "Box",
    "ComHeightTask",
    "Counterfactual",
    "Disturbance",
    "ExcursionTask",
    "Floor",
    "GoTask",
    "HeightWaypoint",
    "Impulse",
    "InitialState",
    "LeanTask",
    "LiftTask",
    "Load",
    "LoopSettings",
    "Obstacle",
    "Patch",
    "PatchPose",
    "PlantSettings",
    "ReachTask",
    "RecordingSettings",
    "Scenario",
    "SensorSettings",
    "Staircase",
    "StandTask",
    "StepTask",
    "Sweep",
    "Task",
    "Tiles",
    "Tread",
    "Variation",
    "VelocityCommand",
    "WalkTask",
    "World",
    "all_boxes",
    "apply_overrides",
    "build_world",
    "check_names",
    "counterfactual",
    "ground_boxes",
    "load_scenario",
    "parse_overrides",
    "resolve_ground",
    "resolve_loads",
    "resolve_obstacles",
    "resolve_patches",
    "robot_path",
    "scenario_json_schema",
    "vary",
]
