"""Whole-body inverse kinematics: can the robot, standing as it stands, bring its palms there, and how?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbmpc.kinematics import Kinematics
from wbmpc.planner.support import UNEVEN
from wbmpc.robot import Robot
from wbmpc.rotations import UP, cross, heading_of, level_frame, rotation_error
from wbmpc.signals import Vector

SOLE_COST, PALM_COST, ELBOW_COST, HEIGHT_COST, POSTURE_COST = 1e4, 1e3, 3e2, 3.0, 2e-3
ELBOW_CLEARANCE = 0.03  # [m] of an elbow over the tangent plane through its palm: the forearm is as thick as the palm
DAMPING = 1e-2
STEP_LIMIT = 0.3  # [rad, m] largest change of one coordinate per iteration
PATIENCE = 60  # iterations for the same targets; what has not converged by then is out of reach
CONVERGED = 1e-5  # [rad, m] step below which the same targets need no further iteration
SETTLED = 2e-3  # [rad, m] step below which a posture says whether its targets are in reach
JOINT_MARGIN = 0.05  # [rad] kept from the joints' ends: a fully stretched arm cannot be controlled


@dataclass(frozen=True, slots=True)
class PalmTarget:
    """Where a palm should be; on a surface with the outward `normal` (3,) its elbow stays above that surface."""

    position: Vector  # (3,) [m] in world
    normal: Vector | None = None


class Posture:
    """Damped Gauss-Newton on  1e4 Σ|sole error|² + 1e3 Σ|palm error|² + 3e2 Σ(elbow too low)²
    + w |c_xy − centre|² + 3 (c_z − nominal)² + 2e-3 |posture error|² + w_t |tilt of the torso|².

    The solution is the posture that needs the least CoM displacement; its CoM tells stage 2 how far a hand may be from
    the CoM (d of the paper), its palm residual whether a place is reachable at all. A few iterations per plan, warm
    started from the last, keep it current while targets move.
    """

    def __init__(self, robot: Robot, *, nominal: Vector, com_cost: float, tilt_cost: float = 0.0) -> None:
        """Start from `nominal` (nq,), the posture to deviate from as little as possible.

        `com_cost`: w [cost / m²]; `tilt_cost`: w_t [cost / rad²].
        """
        self._robot, self._nominal, self._com_cost = robot, nominal, com_cost
        self._tilt_cost = tilt_cost
        self._kinematics = Kinematics(robot)
        self._kinematics.update_kinematics(nominal)
        self._height = float(self._kinematics.com[2])
        feet = np.array([self._kinematics.position(f) for f in robot.sole_frames])
        self._base_offset = nominal[:2] - feet[:, :2].mean(axis=0)  # (2,) [m]
        self._lower, self._upper = robot.joint_lower + JOINT_MARGIN, robot.joint_upper - JOINT_MARGIN
        self.q = nominal.copy()  # (nq,)
        self.com = np.zeros(3)  # [m] of the last iterate
        self.palm_errors = np.zeros(2)  # [m] of the last iterate; 0 without a target
        self.residual = np.inf  # [m] largest palm or sole error of the last iterate
        self.elbow_excess = 0.0  # [m] how far the lowest elbow is under its clearance at the last iterate
        self._reached: tuple[bool, ...] = ()  # which palms had a target
        self._targets: tuple[bytes, ...] = ()
        self._step = np.inf  # [rad, m] largest change of the last iteration
        self._left = PATIENCE

    @property
    def settled(self) -> bool:
        """Whether more iterations for the same targets would change nothing, or have been given up."""
        return self._step < SETTLED or self._left == 0

    def forearm(self, side: int) -> tuple[Vector, Vector]:
        """Palm and elbow (3,) of an arm in world [m] at the last iterate."""
        kinematics, robot = self._kinematics, self._robot
        return kinematics.position(robot.palm_frames[side]), kinematics.position(robot.elbow_frames[side])

    @property
    def torso_up(self) -> Vector:
        """(3,) the torso's own vertical in world at the last iterate."""
        return self._kinematics.rotation(self._robot.torso_frame)[:, 2]

    @property
    def torso_heading(self) -> float:
        """Yaw of the torso at the last iterate [rad]."""
        return heading_of(self._kinematics.rotation(self._robot.torso_frame))

    def iterate(
        self, count: int, *, soles: Vector, yaws: Vector, palms: list[PalmTarget | None], centre: Vector
    ) -> None:
        """Run `count` iterations.

        Args:
            soles: (2, 3) sole positions in world [m].
            yaws: (2,) their headings [rad].
            palms: wanted places of the palms, left and right; None for a free hand.
            centre: (2,) where the CoM should rather be [m].
        """
        robot, kinematics, nv = self._robot, self._kinematics, self._robot.nv
        reached = tuple(p is not None for p in palms)
        if reached != self._reached:  # other hands: from the start, a neighbouring optimum can be a contorted one
            self.q, self._reached = self._start(soles, yaws), reached
        targets = (
            soles.tobytes(),
            yaws.tobytes(),
            centre.tobytes(),
            *(p.position.tobytes() for p in palms if p is not None),
        )
        if targets != self._targets:
            self._targets, self._step, self._left = targets, np.inf, PATIENCE
        for _ in range(count):
            if self._step < CONVERGED or self._left == 0:
                return
            self._left -= 1
            kinematics.update_kinematics(self.q)
            H = np.zeros((nv, nv))
            g = np.zeros(nv)
            self.residual = 0.0
            for side, frame in enumerate(robot.sole_frames):
                level = level_frame(yaws[side])
                J = kinematics.jacobian(frame)
                error = np.concatenate(
                    [
                        soles[side] - kinematics.position(frame),
                        rotation_error(desired=level, measured=kinematics.rotation(frame)),
                    ]
                )
                self.residual = max(self.residual, float(np.linalg.norm(error[:3])))
                H += SOLE_COST * (J.T @ J)
                g += SOLE_COST * (J.T @ error)
            self._add_palms(palms, H, g)
            self.com = kinematics.com
            J = kinematics.com_jacobian[:2]
            H += self._com_cost * (J.T @ J)
            g += self._com_cost * (J.T @ (centre - self.com[:2]))
            J = kinematics.com_jacobian[2]
            H += HEIGHT_COST * np.outer(J, J)
            g += HEIGHT_COST * (self._height + _level(soles) - self.com[2]) * J
            if self._tilt_cost:
                self._add_tilt(H, g)
            diagonal = H.reshape(-1)[:: nv + 1]
            diagonal[6:] += POSTURE_COST
            g[6:] += POSTURE_COST * (self._nominal[7:] - self.q[7:])
            diagonal += DAMPING
            delta = np.asarray(np.linalg.solve(H, g), dtype=np.float64)
            # joints that would leave their range are fixed at it, once, and the rest solved again
            wanted = self.q[7:] + delta[6:]
            outside = np.flatnonzero((wanted < self._lower) | (wanted > self._upper)) + 6
            if outside.size:
                fixed = np.clip(wanted, self._lower, self._upper)[outside - 6] - self.q[7:][outside - 6]
                free = np.setdiff1d(np.arange(nv), outside)
                rest = g[free] - H[np.ix_(free, outside)] @ fixed
                delta[outside] = fixed
                delta[free] = np.linalg.solve(H[np.ix_(free, free)], rest)
            np.clip(delta, -STEP_LIMIT, STEP_LIMIT, out=delta)
            self.q = robot.integrate(self.q, delta)
            np.clip(self.q[7:], self._lower, self._upper, out=self.q[7:])
            self._step = float(np.abs(delta).max())

    def _start(self, soles: Vector, yaws: Vector) -> Vector:
        """The nominal posture (nq,) over the feet: from afar the way there ends in a contorted optimum."""
        q, turn = self._nominal.copy(), level_frame(float(yaws.mean()))
        q[:2] = soles[:, :2].mean(axis=0) + turn[:2, :2] @ self._base_offset
        q[2] += _level(soles)
        q[3:7] = (pin.Quaternion(turn) * pin.Quaternion(q[3:7])).coeffs()
        return q

    def _add_tilt(self, H: Vector, g: Vector) -> None:
        """Add  w_t |angle of the torso's axis to the vertical|²  to the normal equations."""
        frame = self._robot.torso_frame
        J = self._kinematics.jacobian(frame)[3:5]
        error = cross(self._kinematics.rotation(frame)[:, 2], UP)[:2]
        H += self._tilt_cost * (J.T @ J)
        g += self._tilt_cost * (J.T @ error)

    def _add_palms(self, palms: list[PalmTarget | None], H: Vector, g: Vector) -> None:
        """Add the palms' and elbows' terms to the normal equations  H (nv, nv), g (nv,)."""
        robot, kinematics = self._robot, self._kinematics
        self.elbow_excess = 0.0
        self.palm_errors[:] = 0.0
        for side, frame in enumerate(robot.palm_frames):
            target = palms[side]
            if target is None:
                continue
            J = kinematics.jacobian(frame)[:3]
            error = target.position - kinematics.position(frame)
            self.palm_errors[side] = np.linalg.norm(error)
            self.residual = max(self.residual, float(self.palm_errors[side]))
            error *= min(1.0, 0.1 / max(float(np.linalg.norm(error)), 1e-9))
            H += PALM_COST * (J.T @ J)
            g += PALM_COST * (J.T @ error)
            if target.normal is None:
                continue
            elbow = robot.elbow_frames[side]
            height = target.normal @ (kinematics.position(elbow) - kinematics.position(frame))
            excess = ELBOW_CLEARANCE - float(height)
            if excess > 0.0:
                self.elbow_excess = max(self.elbow_excess, excess)
                row = target.normal @ (kinematics.jacobian(elbow)[:3] - J)
                H += ELBOW_COST * np.outer(row, row)
                g += ELBOW_COST * excess * row


def _level(soles: Vector) -> float:
    """Mean height [m] of soles (2, 3) off the floor; 0 where they stand on it, as well as that is known."""
    return float(soles[:, 2].mean()) if np.abs(soles[:, 2]).max() > UNEVEN else 0.0
