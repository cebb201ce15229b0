"""Whole-body inverse kinematics: can the robot, standing as it stands, bring its palms there, and how?"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbmpc.frame_terms import chains_of
from wbmpc.kinematics import Kinematics
from wbmpc.planner.posture_kernel import Targets, posture_step
from wbmpc.planner.support import UNEVEN
from wbmpc.record import record
from wbmpc.rotations import heading_of, level_frame
from wbmpc.signals import Vector

PATIENCE = 60  # iterations for the same targets; what has not converged by then is out of reach
CONVERGED = 1e-5  # [rad, m] step below which the same targets need no further iteration
SETTLED = 2e-3  # [rad, m] step below which a posture says whether its targets are in reach
JOINT_MARGIN = 0.05  # [rad] kept from the joints' ends: a fully stretched arm cannot be controlled


@record
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

    def __init__(self, kinematics: Kinematics, *, nominal: Vector, com_cost: float, tilt_cost: float = 0.0) -> None:
        """Start from `nominal` (nq,), the posture to deviate from as little as possible.

        `kinematics` to compute with, which postures may share: a `pin.Data` is more than 1 MB, and nothing is left in
        it from one call to the next. `com_cost`: w [cost / m²]; `tilt_cost`: w_t [cost / rad²].
        """
        robot = kinematics.robot
        self._robot, self._nominal, self._com_cost = robot, nominal.copy(), com_cost
        self.tilt_cost = tilt_cost  # [cost / rad²]
        self._kinematics = kinematics
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
        frames = (*robot.sole_frames, *robot.palm_frames, *robot.elbow_frames, robot.torso_frame)
        self._views, self._frames = self._kinematics.views, np.array(frames)
        self._chains = chains_of(robot.pin_model, frames)
        self._look()
        self._told = Targets(
            *(np.zeros((2, 3)), np.zeros(2), np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2, np.int64), np.zeros(3))
        )
        self._delta, self._found = np.zeros(robot.nv), np.zeros(5)

    @property
    def settled(self) -> bool:
        """Whether more iterations for the same targets would change nothing, or have been given up."""
        return self._step < SETTLED or self._left == 0

    @property
    def finished(self) -> bool:
        """Whether there will be no more iterations for the same targets."""
        return self._step < CONVERGED or self._left == 0

    def forearm(self, side: int) -> tuple[Vector, Vector]:
        """Palm and elbow (3,) of an arm in world [m] at the last iterate."""
        return self._places[2 + side], self._places[4 + side]

    def iterate(
        self, count: int, *, soles: Vector, yaws: Vector, palms: list[PalmTarget | None], centre: Vector
    ) -> None:
        """Run `count` iterations, at least one.

        Args:
            soles: (2, 3) sole positions in world [m].
            yaws: (2,) their headings [rad].
            palms: wanted places of the palms, left and right; None for a free hand.
            centre: (2,) where the CoM should rather be [m].
        """
        robot, told = self._robot, self._told
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
        if self.finished:
            return
        told.soles[:], told.yaws[:], told.com[:2] = soles, yaws, centre
        told.com[2] = self._height + _level(soles)
        for side, palm in enumerate(palms):
            told.given[side] = 0 if palm is None else 1 if palm.normal is None else 2
            if palm is not None:
                told.palms[side] = palm.position
                told.normals[side] = 0.0 if palm.normal is None else palm.normal
        for _ in range(count):
            if self.finished:
                break
            self._left -= 1
            self._kinematics.update_kinematics(self.q)
            posture_step(
                *(self._views, self._frames, *self._chains, told, self._com_cost, self.tilt_cost),
                *(self.q, self._nominal, self._lower, self._upper, self._delta, self._found),
            )
            self.q = robot.integrate(self.q, self._delta)
            joints = self.q[7:]
            np.maximum(joints, self._lower, out=joints)
            np.minimum(joints, self._upper, out=joints)
            self._step = self._found[4]
        self.com = self._kinematics.com
        self._look()
        self.palm_errors = self._found[:2].copy()
        self.residual, self.elbow_excess = float(self._found[2]), float(self._found[3])

    def _look(self) -> None:
        """Copy what others may ask of the configuration that Pinocchio has just computed."""
        self._places = self._views[3][self._frames[:6], 3]  # (6, 3) [m] soles, palms, elbows
        self.torso = self._kinematics.rotation(self._robot.torso_frame)  # (3, 3) torso to world
        self.torso_heading = heading_of(self.torso)  # [rad]

    def _start(self, soles: Vector, yaws: Vector) -> Vector:
        """The nominal posture (nq,) over the feet: from afar the way there ends in a contorted optimum."""
        q, turn = self._nominal.copy(), level_frame(float(yaws.mean()))
        q[:2] = soles[:, :2].mean(axis=0) + turn[:2, :2] @ self._base_offset
        q[2] += _level(soles)
        q[3:7] = (pin.Quaternion(turn) * pin.Quaternion(q[3:7])).coeffs()
        return q


def _level(soles: Vector) -> float:
    """Mean height [m] of soles (2, 3) off the floor; 0 where they stand on it, as well as that is known."""
    return float(soles[:, 2].mean()) if np.abs(soles[:, 2]).max() > UNEVEN else 0.0
