"""What a scenario may write under `checks:` and `universal:`; one frozen model per check, told apart by `kind`.

Lengths in metres, times in seconds, forces as a fraction of body weight, torques as a fraction of the servo's limit.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from wbmpc.strict import NonNegative, Positive, StrictModel


class CheckSettings(StrictModel):
    """Common to the checks that a scenario lists."""

    name: str | None = Field(default=None, min_length=1, description="name in the results; default: the kind")


# --- universal: on in every scenario, thresholds settable -----------------------------------------------------------


class Completed(StrictModel):
    """The run reached its full duration with a finite state."""

    kind: Literal["completed"] = "completed"


class NoFall(StrictModel):
    """The torso stays up and the CoM stays high, at every tick."""

    kind: Literal["no_fall"] = "no_fall"
    min_torso_up: float = Field(default=0.3, gt=-1, lt=1, description="smallest cosine of the torso's tilt")
    min_com_height: NonNegative = Field(default=0.12, description="[m] smallest CoM height over the lower sole")
    stop_after: Positive | None = Field(
        default=1.0, description="[s] down for so long without a break, the run ends early; null: never"
    )


class DeclaredContacts(StrictModel):
    """Only feet touch the world, and a palm only the object of its chosen patch; the robot never touches itself."""

    kind: Literal["declared_contacts"] = "declared_contacts"
    min_force: NonNegative = Field(default=0.01, description="[N] lighter contacts are ignored")
    release_time: NonNegative = Field(default=0.5, description="[s] a palm may still touch so long after its release")


class Penetration(StrictModel):
    """No contact is deeper than `max`."""

    kind: Literal["penetration"] = "penetration"
    max: Positive = Field(default=0.002, description="[m]")


class TorqueLimit(StrictModel):
    """The applied torque never exceeds what the servo can give at that speed, in that direction."""

    kind: Literal["torque_limit"] = "torque_limit"
    max: Positive = Field(default=1.0, description="largest |torque| / limit")


class SpeedLimit(StrictModel):
    """No joint turns faster than its servo's no-load speed."""

    kind: Literal["speed_limit"] = "speed_limit"
    max: Positive = Field(default=1.0, description="largest |speed| / no-load speed")


class SolverFailures(StrictModel):
    """Few solves fail: tracker fallbacks and failed stages, each as a share of its own number of solves."""

    kind: Literal["solver_failures"] = "solver_failures"
    max: NonNegative = Field(default=0.01, le=1, description="largest share of failed solves")


class MomentumBalance(StrictModel):
    """The contact forces and the declared disturbances explain the CoM's motion: no hidden support exists."""

    kind: Literal["momentum_balance"] = "momentum_balance"
    window: Positive = Field(default=0.05, description="[s] length of the impulse windows")
    max: Positive = Field(default=0.02, description="largest |missing impulse| / (body weight · window)")


class UniversalSettings(StrictModel):
    """The scenario's `universal:` block."""

    completed: Completed = Completed()
    no_fall: NoFall = NoFall()
    declared_contacts: DeclaredContacts = DeclaredContacts()
    penetration: Penetration = Penetration()
    torque_limit: TorqueLimit = TorqueLimit()
    speed_limit: SpeedLimit = SpeedLimit()
    solver_failures: SolverFailures = SolverFailures()
    momentum_balance: MomentumBalance = MomentumBalance()


# --- of a scenario: listed under `checks:` --------------------------------------------------------------------------


class HoldSettings(CheckSettings):
    """Common to the checks of a reach: what counts as the hold.

    The hold is the window of length `hold`, and the hand, with the smallest largest palm-to-target distance.
    """

    hold: Positive = Field(description="[s]")
    target: tuple[float, float, float] | None = Field(
        default=None, description="[m] in world; default: the target of the scenario's reach task"
    )


class Reach(HoldSettings):
    """One palm stays within `max` of the reach target during the whole hold."""

    kind: Literal["reach"]
    max: Positive = Field(description="[m]")


class Withdrawn(CheckSettings):
    """During the last `duration` the robot stands upright, its CoM back where it started, no hand in contact."""

    kind: Literal["withdrawn"]
    com_tolerance: Positive = Field(default=0.02, description="[m] CoM's distance from where it started")
    min_torso_up: float = Field(default=0.9, gt=-1, lt=1, description="smallest cosine of the torso's tilt")
    duration: Positive = Field(default=0.5, description="[s] how long at the end")


class ComBeyondToes(HoldSettings):
    """During the hold the CoM's ground projection is at least `min` outside the feet's support polygon."""

    kind: Literal["com_beyond_toes"]
    min: float = Field(description="[m]")


class BraceForce(HoldSettings):
    """During the hold the hands' normal contact forces sum to at least `min` of the body weight."""

    kind: Literal["brace_force"]
    min: Positive = Field(description="fraction of body weight")


class TorquePeak(CheckSettings):
    """The largest applied torque, as a fraction of the joint's stall torque limit."""

    kind: Literal["torque_peak"]
    max: Positive = Field(le=1, description="largest |torque| / stall torque")


class ContactPatches(CheckSettings):
    """Which patches the planner chose, and how many hand contacts were made.

    `max_count: 0` means: no hand ever touched anything and stage 3 never fired.
    """

    kind: Literal["contact_patches"]
    allowed: tuple[str, ...] | None = Field(default=None, description="patches that may be chosen; default: any")
    min_count: int = Field(default=0, ge=0, description="fewest hand contacts made")
    max_count: int | None = Field(default=None, ge=0, description="most hand contacts made; default: any number")


class ComHeight(CheckSettings):
    """The CoM comes within `max` of the height of every waypoint of the scenario's com_height task, about its time."""

    kind: Literal["com_height"]
    max: Positive = Field(description="[m]")
    window: NonNegative = Field(default=0.1, description="[s] half-width around the waypoint's time")


class UprightAtEnd(CheckSettings):
    """During the last `duration` the robot stands upright and still."""

    kind: Literal["upright_at_end"]
    min_torso_up: float = Field(default=0.95, gt=-1, lt=1, description="smallest cosine of the torso's tilt")
    max_com_speed: Positive = Field(default=0.05, description="[m/s]")
    duration: Positive = Field(default=0.5, description="[s]")


class PushRecovery(CheckSettings):
    """A push of at least `min_impulse` per kg really acted, and the CoM was captured.

    The value is the time from the push's end until the CoM speed stays below `max_com_speed` for good.
    """

    kind: Literal["push_recovery"]
    min_impulse: Positive = Field(description="[N·s/kg] per kg of robot, sum over the declared pushes' directions")
    max_time: Positive = Field(default=3.0, description="[s]")
    max_com_speed: Positive = Field(default=0.05, description="[m/s]")


ScenarioCheck = Annotated[
    Reach
    | Withdrawn
    | ComBeyondToes
    | BraceForce
    | TorquePeak
    | ContactPatches
    | ComHeight
    | UprightAtEnd
    | PushRecovery,
    Field(discriminator="kind"),
]
