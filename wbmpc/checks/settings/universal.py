"""The `universal:` block: checks that are on in every scenario; their thresholds can be set, none switched off."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wbmpc.strict import NonNegative, Positive, StrictModel


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
    """Feet touch only what is made for walking, a palm only the object of its chosen patch, and nothing else touches.

    Made for walking are the floor and the objects declared `walkable`. The robot never touches itself.
    """

    kind: Literal["declared_contacts"] = "declared_contacts"
    min_force: NonNegative = Field(default=0.01, description="[N] lighter contacts are ignored")
    release_time: NonNegative = Field(default=0.5, description="[s] a palm may still touch so long after its release")


class Penetration(StrictModel):
    """No contact is deeper than `max`."""

    kind: Literal["penetration"] = "penetration"
    max: Positive = Field(default=0.002, description="[m] deepest contact")


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
