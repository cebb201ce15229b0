"""Settings of the tracker: gains, weights and limits of its one QP per tick.

A gain pair (stiffness k [1/s²], damping d [1/s]) makes the wanted acceleration  a_ref + k (x_ref − x) + d (v_ref − v).
Weights are in [cost / (m/s²)²] for positions and [cost / (rad/s²)²] for rotations and joints.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wbmpc.strict import StrictModel


class TrackerSettings(StrictModel):
    """The scenario's `tracker:` block."""

    assembly: Literal["fused", "plain"] = Field(
        "fused", description="who writes the program: compiled code, or the numpy code that it is checked against"
    )
    qp_backend: str = Field("daqp", description="QP backend: daqp, osqp or any name of qpsolvers")

    com_stiffness: float = Field(60.0, ge=0, description="[1/s²] of the CoM's distance from its plan")
    com_damping: float = Field(18.0, ge=0, description="[1/s] of the CoM's velocity against its plan")
    com_integral: float = Field(20.0, ge=0, description="[1/s³] removes what an unmodelled load leaves of the height")
    com_integral_limit: float = Field(2.0, ge=0, description="[m/s²] bound on the integral's share")
    com_weight: float = Field(200.0, gt=0, description="[cost / (m/s²)²] of the CoM's horizontal acceleration")
    com_height_weight: float = Field(100.0, gt=0, description="[cost / (m/s²)²] of the CoM's vertical acceleration")
    momentum_damping: float = Field(8.0, ge=0, description="[1/s] L̇ = −d L about the CoM")
    momentum_weight: float = Field(20.0, ge=0, description="[cost / (N·m)²] of the wanted rate of the angular momentum")
    torso_stiffness: float = Field(60.0, ge=0, description="[1/s²] of the torso's rotation from its plan")
    torso_damping: float = Field(12.0, ge=0, description="[1/s] of the torso's angular velocity")
    torso_weight: float = Field(0.1, ge=0, description="[cost / (rad/s²)²] of the torso's angular acceleration")
    stance_damping: float = Field(30.0, ge=0, description="[1/s] of a stance foot's and a braced palm's velocity")
    stance_stiffness: float = Field(60.0, ge=0, description="[1/s²] of a stance foot's place: it matters in the air")
    stance_weight: float = Field(1000.0, gt=0, description="[cost / (m/s²)²] of a stance foot's acceleration")
    swing_stiffness: float = Field(250.0, ge=0, description="[1/s²] of a swing foot's distance from its path")
    swing_damping: float = Field(30.0, ge=0, description="[1/s] of a swing foot's velocity")
    swing_weight: float = Field(100.0, gt=0, description="[cost / (m/s²)²] of a swing foot's acceleration")
    hand_stiffness: float = Field(110.0, ge=0, description="[1/s²] of a moving hand's distance from its path")
    hand_damping: float = Field(21.0, ge=0, description="[1/s] of a moving hand's velocity")
    hand_weight: float = Field(5.0, gt=0, description="[cost / (m/s²)²] of a moving hand's acceleration")
    hand_acceleration_limit: float = Field(5.0, gt=0, description="[m/s²] clip: the CoM must dominate the hands")
    urgent_hand_weight: float = Field(
        300.0, gt=0, description="[cost / (m/s²)²] hand_weight of a hand that must be in time"
    )
    urgent_hand_acceleration_limit: float = Field(
        25.0, gt=0, description="[m/s²] hand_acceleration_limit of a hand that must be in time"
    )
    hand_integral: float = Field(60.0, ge=0, description="[1/s³] removes the steady error of a hand")
    hand_integral_limit: float = Field(3.0, ge=0, description="[m/s²] bound on the integral's share")
    braced_weight: float = Field(
        200.0, gt=0, description="[cost / (m/s²)²] of a palm in contact that should stay where it is"
    )
    carry_weight: float = Field(
        50.0, gt=0, description="[cost / (m/s²)²] of a palm that holds a thing together with the other one"
    )
    posture_stiffness: float = Field(60.0, ge=0, description="[1/s²] of each joint's angle from its reference")
    posture_damping: float = Field(12.0, ge=0, description="[1/s] of each joint's velocity")
    posture_weight: float = Field(0.02, gt=0, description="[cost / (rad/s²)²] of each joint's acceleration")
    hand_force_weight: float = Field(0.02, ge=0, description="[cost / N²] of a hand's force against its plan")
    hand_force_rise: float = Field(5.0, gt=0, description="[N] by which a planned palm force may exceed the sensed one")
    force_regularization: float = Field(1e-4, gt=0, description="[cost / N²] of every contact force")
    acceleration_regularization: float = Field(1e-4, gt=0, description="[cost / (rad/s²)²] of every joint")

    foot_friction: float = Field(0.35, gt=0, description="friction coefficient that the soles count on")
    foot_yaw_radius: float = Field(0.02, gt=0, description="[m] yaw moment / (friction · normal force) of a sole")
    foot_inset: float = Field(0.002, ge=0, description="[m] inset of the sole's rectangle for its centre of pressure")
    foot_comfort_inset: float = Field(
        0.01, ge=0, description="[m] inset within which the centre of pressure stays unless it must save the balance"
    )
    foot_comfort_weight: float = Field(300.0, gt=0, description="[cost / (N·m)²] price of leaving the comfort inset")
    trunk_clearance: float = Field(0.08, ge=0, description="[m] of an arm's axis from the trunk's")
    elbow_clearance: float = Field(0.025, description="[m] of an elbow over the plane its palm rests on, palm's centre")
    clearance_stiffness: float = Field(400.0, ge=0, description="[1/s²] of an arm that is too near")
    clearance_damping: float = Field(40.0, ge=0, description="[1/s] of an arm that is too near")
    clearance_weight: float = Field(50.0, gt=0, description="[cost / (m/s²)²] price of an arm too near")
    joint_velocity_limit: float = Field(4.6, gt=0, description="[rad/s] of every joint")
    limit_horizon: float = Field(0.025, gt=0, description="[s] within which a joint may stop before its limit")
    torque_share: float = Field(0.95, gt=0, le=1, description="share of the servo's torque that may be planned")
    fallback_damping: float = Field(0.05, ge=0, description="[N·m·s/rad] added to the last torque after a failed solve")
