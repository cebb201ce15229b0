"""TSID on recorded states, in an interpreter of its own: its Pinocchio is not this project's.

    .venv-peers/bin/python benchmarks/tsid_server.py MODEL.xml TICKS.npz ANSWER.npz

Started by benchmarks/tsid_client.py, which says what the arrays of TICKS.npz are. Reads lines `FORMULATION FIRST LAST`
from standard input, solves these ticks, and answers each line with the seconds of every tick as JSON: references set,
problem data computed, solved. At the end of the input it writes the accelerations, and the normal force of the least
loaded corner, to ANSWER.npz.
"""

from __future__ import annotations

import json
import sys
from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin
from tsid import tsid_pywrap as tsid  # the wheel of 1.7.1 puts its __init__ one folder too deep

HARD, COST = 0, 1  # TSID's two priorities
SIDES = ("left", "right")
UNBOUNDED = 1e10  # of base accelerations and forces


class Formulation:
    """One InverseDynamicsFormulationAccForce with the tasks, weights and gains of `settings`.

    `contacts` is the priority of the contacts' motion: COST as in this project's tracker, HARD as in TSID's examples.
    """

    def __init__(self, model: pin.Model, ticks: dict[str, np.ndarray], settings: dict[str, Any], contacts: int) -> None:
        self.ticks, self.settings = ticks, settings
        self.robot = tsid.RobotWrapper(model, False)
        self.formulation = tsid.InverseDynamicsFormulationAccForce("tsid", self.robot, False)
        # Positions and velocities before any task is made: tasks read them.
        self.formulation.computeProblemData(0.0, ticks["q"][0], ticks["v"][0])
        self._contacts(contacts)
        self._tasks()
        self._limits()
        self.solver = tsid.SolverHQuadProgFast("eiquadprog-fast")
        self.solver.resize(self.formulation.nVar, self.formulation.nEq, self.formulation.nIn)
        self.accelerations = np.full((len(ticks["q"]), model.nv), np.nan)
        self.least_corner = np.full(len(ticks["q"]), np.nan)  # [N] normal force of the least loaded corner of a sole

    def _contacts(self, priority: int) -> None:
        s, ticks = self.settings, self.ticks
        x, y = s["sole"]
        corners = np.array([[x, x, -x, -x], [y, -y, y, -y], [0.0, 0.0, 0.0, 0.0]])
        up = np.array([0.0, 0.0, 1.0])
        for side, name in enumerate(SIDES):
            sole = tsid.Contact6d(name, self.robot, f"{name}_sole", corners, up, s["foot_friction"], 0.0, UNBOUNDED)
            sole.setKp(np.array([s["stance_stiffness"]] * 2 + [0.0] * 4))
            sole.setKd(np.full(6, s["stance_damping"]))
            sole.setRegularizationTaskWeightVector(np.ones(6))
            place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, s["foot_yaw"][side]), ticks["foot_position"][0, side])
            sole.setReference(place)
            self.formulation.addRigidContact(sole, s["force_regularization"], s["stance_weight"], priority)
            setattr(self, name, sole)
        name = f"{SIDES[s['brace']]}_palm"
        palm = tsid.ContactPoint(name, self.robot, name, ticks["normal"][0], s["palm_friction"], 0.0, UNBOUNDED)
        palm.useLocalFrame(False)
        palm.setKp(np.zeros(3))
        palm.setKd(np.full(3, s["stance_damping"]))
        palm.setRegularizationTaskWeightVector(np.ones(3))
        palm.setReference(self.robot.framePosition(self.formulation.data(), self.robot.model().getFrameId(name)))
        self.formulation.addRigidContact(palm, s["hand_force_weight"], s["braced_weight"], priority)
        self.palm = palm

    def _tasks(self) -> None:
        s, robot = self.settings, self.robot
        nj = robot.na
        self.com = tsid.TaskComEquality("com", robot)
        self.momentum = tsid.TaskAMEquality("momentum", robot)
        self.torso = tsid.TaskSE3Equality("torso", robot, "torso")
        self.hand = tsid.TaskSE3Equality("hand", robot, f"{SIDES[1 - s['brace']]}_palm")
        self.posture = tsid.TaskJointPosture("posture", robot)
        self.torso.setMask(np.array([0.0] * 3 + [1.0] * 3))
        self.hand.setMask(np.array([1.0] * 3 + [0.0] * 3))
        self.hand.useLocalFrame(False)
        self.momentum.setKp(np.full(3, s["momentum_damping"]))
        self.momentum.setKd(np.zeros(3))
        self.momentum.setReference(tsid.TrajectorySample(3, 3))
        for task, name, size in (
            (self.com, "com", 3),
            (self.torso, "torso", 6),
            (self.hand, "hand", 6),
            (self.posture, "posture", nj),
        ):
            task.setKp(np.full(size, s[f"{name}_stiffness"]))
            task.setKd(np.full(size, s[f"{name}_damping"]))
        for task, name in (
            (self.com, "com"),
            (self.momentum, "momentum"),
            (self.torso, "torso"),
            (self.hand, "hand"),
            (self.posture, "posture"),
        ):
            self.formulation.addMotionTask(task, s[f"{name}_weight"], COST, 0.0)
        self.com_sample = tsid.TrajectorySample(3)
        self.se3_sample = tsid.TrajectorySample(12, 6)
        self.joint_sample = tsid.TrajectorySample(nj)

    def _limits(self) -> None:
        robot = self.robot
        self.torques = tsid.TaskActuationBounds("torques", robot)
        self.formulation.addActuationTask(self.torques, 1.0, HARD, 0.0)
        self.joints = tsid.TaskJointBounds("joints", robot, self.settings["limit_horizon"])
        speed = np.full(robot.na, self.settings["joint_velocity_limit"])
        self.joints.setVelocityBounds(-speed, speed)
        self.formulation.addMotionTask(self.joints, 1.0, HARD, 0.0)

    def solve(self, k: int) -> tuple[float, float, float]:
        """Tick `k`: seconds of setting references, of computing the problem, of solving it."""
        ticks = self.ticks
        start = perf_counter()
        sample = self.com_sample
        sample.value(ticks["com"][k, 0])
        sample.derivative(ticks["com"][k, 1])
        sample.second_derivative(ticks["com"][k, 2])
        self.com.setReference(sample)
        sample = self.se3_sample
        for task, name in ((self.torso, "torso"), (self.hand, "hand")):
            sample.value(ticks[f"{name}_pose"][k])
            sample.derivative(ticks[f"{name}_velocity"][k])
            sample.second_derivative(ticks[f"{name}_acceleration"][k])
            task.setReference(sample)
        sample = self.joint_sample
        sample.value(ticks["joint_position"][k])
        sample.derivative(ticks["joint_velocity"][k])
        self.posture.setReference(sample)
        self.palm.setForceReference(ticks["force"][k])
        self.palm.setMaxNormalForce(float(ticks["force_cap"][k]))
        self.torques.setBounds(ticks["torque_lower"][k], ticks["torque_upper"][k])
        self.joints.setAccelerationBounds(ticks["acceleration_lower"][k], ticks["acceleration_upper"][k])
        referenced = perf_counter()
        data = self.formulation.computeProblemData(0.0, ticks["q"][k], ticks["v"][k])
        computed = perf_counter()
        solution = self.solver.solve(data)
        end = perf_counter()
        if solution.status == 0:
            self.accelerations[k] = self.formulation.getAccelerations(solution)
            self.least_corner[k] = self.formulation.getContactForces(solution)[2:24:3].min()
        return referenced - start, computed - referenced, end - computed


def main() -> None:
    """Serve until the input ends."""
    model_path, ticks_path, answer_path = sys.argv[1:]
    model = pin.buildModelFromMJCF(model_path)
    # This Pinocchio adds the free body's place in the file to its configuration; MuJoCo and its successors do not.
    model.jointPlacements[1] = pin.SE3.Identity()
    with np.load(ticks_path, allow_pickle=False) as data:
        ticks = {name: data[name] for name in data.files}
    settings = json.loads(str(ticks.pop("settings")))
    formulations = {
        "costs": Formulation(model, ticks, settings, COST),
        "equations": Formulation(model, ticks, settings, HARD),
    }
    first = formulations["costs"]
    sizes = {"variables": first.formulation.nVar, "equalities": first.formulation.nEq, "rows": first.formulation.nIn}
    print(json.dumps(sizes), flush=True)
    for line in sys.stdin:
        name, begin, end = line.split()
        print(json.dumps([formulations[name].solve(k) for k in range(int(begin), int(end))]), flush=True)
    accelerations = {name: formulation.accelerations for name, formulation in formulations.items()}
    np.savez(answer_path, least_corner=first.least_corner, **accelerations)


if __name__ == "__main__":
    main()
