"""What a scenario may set about the planner. Defaults are the values all shipped scenarios run with."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wbmpc.strict import StrictModel


class HeightSettings(StrictModel):
    """Stage 1: the CoM height."""

    jerk_cost: float = Field(1e-6, gt=0, description="[cost / (m/s³)²] weight of the vertical jerk")
    velocity_cost: float = Field(1e-2, ge=0, description="[cost / (m/s)²] weight of the vertical velocity")
    position_cost: float = Field(1.0, ge=0, description="[cost / m²] weight of the distance to the wanted height")
    middle_share: float = Field(
        0.0, ge=0, le=1, description="share of position_cost that draws to the middle of the band, the paper's remark"
    )
    limit_slack_cost: float = Field(1e5, gt=0, description="[cost / m²] price of leaving the legs' range")
    band_slack_cost: float = Field(1e3, gt=0, description="[cost / m²] price of leaving the band of an end-effector")
    lowest: float = Field(0.16, gt=0, description="[m] lowest CoM above the feet that the legs allow")
    highest: float = Field(0.275, gt=0, description="[m] highest CoM above the feet that the legs allow")
    reach: float = Field(
        0.22, gt=0, description="[m] d of the paper: largest vertical distance between CoM and a hand's target"
    )
    enabled: bool = Field(True, description="false freezes the CoM height at its initial value (a counterfactual)")


class WholeBodySettings(StrictModel):
    """Stage 2: horizontal CoM, ΔZ and joint velocities."""

    jerk_cost: float = Field(1e-4, gt=0, description="[cost / (m/s³)²] α₁ of the paper, on the CoM's jerk")
    delta_z_cost: float = Field(0.2, gt=0, description="[cost / m²] α₂, on the square of ΔZ")
    delta_z_price: float = Field(2.0, ge=0, description="[cost / m] on |ΔZ|: help that is worth less is not asked for")
    joint_velocity_cost: float = Field(1e-3, gt=0, description="[cost / (rad/s)²] α₃, on joint velocities")
    upper_body_share: float = Field(
        30.0, gt=0, description="factor on α₃ of the joints that move no foot, but for an arm that has a task"
    )
    com_velocity_cost: float = Field(1000.0, gt=0, description="[cost / (m/s)²] α₄, joint velocities against CoM plan")
    hand_velocity_cost: float = Field(10.0, gt=0, description="[cost / (m/s)²] α₅, joint velocities against hands")
    velocity_cost: float = Field(0.1, ge=0, description="[cost / (m/s)²] damping of the CoM over the horizon")
    position_cost: float = Field(5e-2, ge=0, description="[cost / m²] pull of the CoM to the support's centre")
    reach_slack_cost: float = Field(1e3, gt=0, description="[cost / m²] price of a hand beyond its reach |R - C| <= d")
    footstep_cost: float = Field(1000.0, gt=0, description="[cost / m²] a footstep away from where the task puts it")
    zmp_centre_cost: float = Field(
        50.0, ge=0, description="[cost / m²] a ZMP off the centre of the foot that carries a step alone"
    )
    foot_slack_cost: float = Field(1e5, gt=0, description="[cost / m²] price of a foot where it must not be")
    zmp_slack_cost: float = Field(1e5, gt=0, description="[cost / m²] price of a ZMP outside its bounds")
    rest_slack_cost: float = Field(1e4, gt=0, description="[cost / m²] price of a plan that cannot stop at its end")
    zmp_margin: float = Field(0.018, ge=0, description="[m] inset of the support polygon")
    zmp_margin_alarm: float = Field(
        0.0, description="[m] the inset when the measured capture point is far off the plan: a push; negative: outside"
    )
    zmp_margin_step: float = Field(
        0.012, description="[m] the same while walking: a plan that counts on the toes puts the next step too near"
    )
    alarm_urgency: float = Field(
        100.0, ge=1, description="factor on velocity_cost and position_cost when the capture point is far off the plan"
    )
    zmp_margin_growth: float = Field(
        0.008, ge=0, description="[m/s] growth of the inset over the horizon: room to react to what is not known yet"
    )
    posture_rate: float = Field(1.0, ge=0, description="[1/s] pull of the joint velocities to the nominal posture")
    torso_cost: float = Field(3.0, ge=0, description="[cost / (rad/s)²] of the torso's rate against its pull")
    torso_rate: float = Field(4.0, ge=0, description="[1/s] pull of the torso to upright, or to a reach's posture")
    tracking_rate: float = Field(8.0, gt=0, description="[1/s] pull of the joint reference to its CoM, hands and feet")


class GaitSettings(StrictModel):
    """Steps: their timing, their size, the swing foot."""

    swing_time: float = Field(
        0.45, gt=0.1, description="[s] single support of a walking step: so low a CoM falls e times further in 0.16 s"
    )
    double_support: float = Field(0.05, gt=0.02, description="[s] between two walking steps")
    first_double_support: float = Field(0.5, gt=0.1, description="[s] to shift the weight before the first step")
    stride_double_support: float = Field(1.0, gt=0.1, description="[s] before a step that is planned with a posture")
    step_height: float = Field(0.025, gt=0, description="[m] how high a swing foot is lifted over the ground")
    crouch: float = Field(0.015, ge=0, description="[m] by which a walking CoM is lower: legs need length to step out")
    step_width: float = Field(0.09, gt=0, description="[m] between the soles' centres when walking")
    turning_room: float = Field(
        0.07, ge=0, description="[m] by which that width grows with the sine of the angle between the soles"
    )
    narrowest: float = Field(0.08, gt=0, description="[m] smallest width between the soles' centres")
    widest: float = Field(0.20, gt=0, description="[m] largest width between the soles' centres")
    longest: float = Field(0.14, gt=0, description="[m] largest distance of a foot ahead of or behind the other")
    foot_speed: float = Field(0.8, gt=0, description="[m/s] how fast a swing foot's landing place may be moved")
    adapt_footsteps: bool = Field(True, description="false fixes the footsteps where the task puts them")
    landing_force: float = Field(4.0, gt=0, description="[N] normal force that counts as landed")
    search_depth: float = Field(0.02, ge=0, description="[m] how far below the ground a late foot is lowered")
    search_speed: float = Field(0.06, gt=0, description="[m/s] how fast a late foot is lowered")


class ContactSettings(StrictModel):
    """Stage 3 and the life of a contact around it."""

    need_threshold: float = Field(0.002, gt=0, description="[m] largest |ΔZ| that needs no contact")
    quiet_threshold: float = Field(0.001, gt=0, description="[m] |ΔZ| below which a held contact is not needed")
    quiet_time: float = Field(0.3, gt=0, description="[s] how long ΔZ stays quiet before the contact is unloaded")
    ramp_time: float = Field(0.3, gt=0, description="[s] ramp of the force cap up and down")
    sensed_force: float = Field(0.3, gt=0, description="[N] normal force that counts as touched")
    approach_clearance: float = Field(0.03, gt=0, description="[m] distance above the patch where the descent begins")
    approach_speed: float = Field(0.18, gt=0, description="[m/s] mean speed of the hand towards the clearance point")
    touch_speed: float = Field(0.06, gt=0, description="[m/s] speed of the descent: bounds the impact")
    urgent_acceleration: float = Field(36.0, gt=0, description="[m/s²] of the hand when the robot is falling")
    urgent_touch_speed: float = Field(0.2, gt=0, description="[m/s] speed at which that hand meets the surface")
    urgent_time: float = Field(0.22, gt=0, description="[s] a hand that needs longer comes too late to stop a fall")
    urgent_ramp_time: float = Field(0.02, gt=0, description="[s] ramp of the force cap after such a landing")
    search_depth: float = Field(0.03, gt=0, description="[m] how far below the patch a descent looks for it")
    force_cost: float = Field(1.0, gt=0, description="[cost] weight of (n·f)²/(m g)²")
    tangent_cost: float = Field(
        5.0, gt=0, description="[cost] weight of |f_t|²/(m g)²: friction is uncertain and turns the feet"
    )
    shift_slack_cost: float = Field(1.0, gt=0, description="[cost / m²] price of a ΔZ that the force does not give")
    distance_cost: float = Field(0.4, ge=0, description="[cost / m] w_i per metre between the hand and candidate i")
    reach_margin: float = Field(0.005, ge=0, description="[m] IK residual up to which a candidate counts as reachable")
    most_contacts: int = Field(2, ge=1, le=2, description="hands in contact at once, the paper's ΣH: 1 or 2")
    most_candidates: int = Field(16, ge=1, le=64, description="candidates that one firing considers, nearest first")


class PlannerSettings(StrictModel):
    """The three-stage MPC."""

    formulation: Literal["paper", "exact"] = Field(
        "exact", description="which ΔZ: the paper's (with its phantom term) or the exact one"
    )
    horizon_steps: int = Field(16, ge=2, le=64, description="N, knots of the preview")
    horizon_step: float = Field(0.1, gt=0, le=0.5, description="T [s], time between knots")
    contact_stage: bool = Field(True, description="false turns stage 3 off: ΔZ = 0 always (a counterfactual)")
    qp_backend: str = Field("daqp", description="QP backend of stages 1 and 2: daqp, osqp or any name of qpsolvers")
    miqp_backend: Literal["enumeration", "daqp", "highs"] = Field(
        "enumeration",
        description="stage 3: enumeration with one small QP a knot, or its plain (MI)QPs, the choice on daqp or highs",
    )
    feedback: float = Field(0.02, ge=0, le=1, description="share of the measured CoM error taken over at every plan")
    feedback_large: float = Field(
        0.5, ge=0, le=1, description="share of the measured CoM error taken over where it is above 2 feedback_knee"
    )
    feedback_knee: float = Field(0.005, gt=0, description="[m] capture-point error from which the share grows")
    height: HeightSettings = Field(HeightSettings(), description="Stage 1: the CoM height.")
    whole_body: WholeBodySettings = Field(
        WholeBodySettings(), description="Stage 2: horizontal CoM, ΔZ and joint velocities."
    )
    gait: GaitSettings = Field(GaitSettings(), description="Steps: timing, size, the swing foot.")
    contact: ContactSettings = Field(ContactSettings(), description="Stage 3 and the life of a contact.")
