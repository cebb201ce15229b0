"""The root of a scenario file."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, PrivateAttr, StringConstraints
from ruamel.yaml import YAML

from wbmpc.checks.settings import ScenarioCheck, UniversalSettings
from wbmpc.planner.settings import PlannerSettings
from wbmpc.scenario.schema.experiments import Counterfactual, Sweep
from wbmpc.scenario.schema.loop import InitialState, LoopSettings, RecordingSettings
from wbmpc.scenario.schema.plant import Disturbance, PlantSettings, SensorSettings
from wbmpc.scenario.schema.tasks import Task
from wbmpc.scenario.schema.world import Patch, World
from wbmpc.strict import Identifier, Positive, StrictModel
from wbmpc.tracker.settings import TrackerSettings

FileName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]


class Scenario(StrictModel):
    """A scenario is data: what exists and what is asked for, never which contact to make or when."""

    name: FileName = Field(description="Names the results: letters, digits, '_' and '-'.")
    description: str = Field(default="", description="What the scenario shows, in a sentence.")
    paper: str = Field(default="", description="The figure of the paper that it repeats; empty: an extension of it.")
    robot: str = Field(
        default="surena_mini",
        min_length=1,
        description="A model of models/ by name, or the path of an .xml file relative to this file.",
    )
    seed: int = Field(default=0, ge=0, lt=2**63, description="Seed of all random numbers of a run [-].")
    duration: Annotated[Positive, Field(le=3600)] = Field(description="Simulated time of a run [s].")
    initial: InitialState = Field(default=InitialState(), description="Posture at the beginning.")
    world: World = Field(default=World(), description="Floor and objects.")
    patches: dict[Identifier, Patch] = Field(default={}, description="Candidate contact patches by name.")
    tasks: tuple[Task, ...] = Field(min_length=1, description="What the robot is asked to do.")
    disturbances: tuple[Disturbance, ...] = Field(default=(), description="Pushes; the controller is not told.")
    plant: PlantSettings = Field(
        default=PlantSettings(), description="How the plant differs from the model; the controller is not told."
    )
    sensors: SensorSettings = Field(default=SensorSettings(), description="Sensor noise.")
    loop: LoopSettings = Field(default=LoopSettings(), description="Rates of the loop.")
    planner: PlannerSettings = Field(default=PlannerSettings(), description="Settings of the three stages.")
    tracker: TrackerSettings = Field(default=TrackerSettings(), description="Settings of the 1 kHz tracker.")
    recording: RecordingSettings = Field(default=RecordingSettings(), description="What goes to the recording.")
    universal: UniversalSettings = Field(
        default=UniversalSettings(), description="Thresholds of the checks that are always on."
    )
    checks: tuple[ScenarioCheck, ...] = Field(min_length=1, description="What a run must show to pass.")
    counterfactuals: dict[Identifier, Counterfactual] = Field(
        default={}, description="Changed runs by name, with the outcome that each must have."
    )
    sweep: Sweep | None = Field(default=None, description="Ranges for `wbmpc sweep`; null: no sweep declared.")

    # Not a key of the file: relative paths (`robot`) and messages need to know where the scenario came from.
    _source: Path = PrivateAttr(default=Path("scenario.yaml"))

    @property
    def source(self) -> Path:
        """The file this scenario was read from; a relative path is relative to the working directory."""
        return self._source

    def to_document(self) -> dict[str, Any]:
        """The effective scenario, every default written out, as plain data that validates to an equal scenario."""
        return self.model_dump(mode="json")

    def to_yaml(self) -> str:
        """The effective scenario as YAML text that `load_scenario` reads back."""
        yaml, stream = YAML(), StringIO()
        yaml.width = 1_000_000  # folded, long escaped texts gain blanks
        yaml.allow_unicode = False  # escapes: written raw, some Unicode characters read back as line breaks
        yaml.dump(self.to_document(), stream)
        return stream.getvalue()
