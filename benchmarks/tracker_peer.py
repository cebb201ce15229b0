"""The tracker against TSID, C++ task-space inverse dynamics, on the same robot, states, tasks, weights and limits.

Three times one QP a tick: the tracker as shipped, the tracker on TSID's tasks, and TSID, which runs in an interpreter
of its own (benchmarks/tsid_server.py). Blocks of consecutive ticks alternate, so that all see the same machine.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.braced_states import Ticks, plain, record
from benchmarks.report import Section, Table, micro, ratio
from wbmpc.kinematics import Kinematics
from wbmpc.loop import no_garbage_collection
from wbmpc.signals import TorqueCommand
from wbmpc.tracker.settings import TrackerSettings
from wbmpc.tracker.tracker import Tracker

ROOT = Path(__file__).parents[1]
PEERS = ROOT / ".venv-peers" / "bin" / "python"
BLOCK = 50  # ticks
ROUNDS = 3  # over all ticks
TOLERANCE = 5e-3  # of the accelerations' norm
PRESSED = 1e-3  # [N] on every corner of both soles
FRICTION_SPEED = 0.1  # [rad/s] see Tracker: dry friction is compensated by the wanted speed
# What TSID has no counterpart for is switched off or out of reach: integrals, clips, comfort, clearance, filters. Its
# CoM task has one weight, and its soles bound the yaw moment by their corners' friction alone.
MATCHED = TrackerSettings(
    com_height_weight=200.0,
    com_integral=0.0,
    hand_integral=0.0,
    hand_acceleration_limit=1e6,
    hand_force_rise=1e6,
    acceleration_regularization=1e-8,
    foot_comfort_inset=0.002,
    foot_yaw_radius=1.0,
    trunk_clearance=0.0,
    elbow_clearance=-1.0,
)


SHIPPED, MATCHING = "tracker, as shipped", "tracker, TSID's tasks"
FORMULATIONS = {"TSID, contacts as costs": "costs", "TSID, contacts as equations": "equations"}
NOTE = """{ticks} consecutive ticks of `reach` with both feet and a braced palm in contact. TSID 1.7.1 with Pinocchio
3.4 and eiquadprog-fast, {sizes}; its times are taken inside of its own interpreter: references set from Python,
problem data computed, solved. Ours are those of `Tracker.solve`, everything from the state to the torques. On TSID's
tasks the tracker's rows of comfort, clearance and keep-out are still there and do not bind; integrals, clips and
filters are off. Tolerance: {tolerance:g} of the accelerations' norm. With contacts as costs both solve the same QP but
for the soles' yaw moment: corner forces bound it by where the pressure is, wrench rows by a radius. It shows where the
pressure is at an edge; where all corners press, the answers are equal. Contacts as equations, the way of TSID's
examples, have no compliance and so another optimum."""


def arrays(ticks: Ticks, settings: TrackerSettings) -> dict[str, Any]:
    """What TSID is told of every tick, with its gains and weights as JSON in `settings`."""
    robot, states, setpoints = ticks.robot, ticks.states, ticks.setpoints
    brace, free = ticks.brace, 1 - ticks.brace
    q, v = (np.array([getattr(state, name) for state in states]) for name in "qv")
    joint_velocity = np.array([s.joint_velocity for s in setpoints])
    kinematics = Kinematics(robot)
    palm_rotation = []
    for configuration in q:
        kinematics.update_kinematics(configuration)
        palm_rotation.append(kinematics.rotation(robot.palm_frames[free]))
    # The servo's torque-speed line, less what damping and dry friction of the joint take.
    stall, share = settings.torque_share * robot.torque_limit, v[:, 6:] / robot.joint_speed
    friction = robot.damping * v[:, 6:] + robot.frictionloss * np.tanh(joint_velocity / FRICTION_SPEED)
    h = settings.limit_horizon
    ahead = q[:, 7:] + h * v[:, 6:]
    kept = settings.model_dump(include={name for name in TrackerSettings.model_fields if name != "qp_backend"})
    kept |= {
        "brace": brace,
        "sole": (robot.sole_half_extents - settings.foot_inset).tolist(),
        "foot_yaw": setpoints[0].foot_yaw.tolist(),
        # The tracker counts on the pyramid inside of the friction cone, TSID on the one with this slope.
        "foot_friction": settings.foot_friction / np.sqrt(2.0),
        "palm_friction": float(setpoints[0].hand_friction[brace]) / np.sqrt(2.0),
    }
    zeros = np.zeros((len(q), 3))
    return {
        "settings": json.dumps(kept),
        "q": q,
        "v": v,
        "com": np.array([(s.com_position, s.com_velocity, s.com_acceleration) for s in setpoints]),
        "foot_position": np.array([s.foot_position for s in setpoints]),
        "normal": np.array([s.hand_normal[brace] for s in setpoints]),
        "force": np.array([s.hand_force[brace] for s in setpoints]),
        "force_cap": np.array([s.hand_force_cap[brace] for s in setpoints]),
        "torso_pose": np.array([_pose(np.zeros(3), s.torso_rotation) for s in setpoints]),
        "torso_velocity": np.hstack([zeros, [s.torso_angular_velocity for s in setpoints]]),
        "torso_acceleration": np.hstack([zeros, zeros]),
        "hand_pose": np.array(
            [_pose(s.hand_position[free], R) for s, R in zip(setpoints, palm_rotation, strict=True)]
        ),  # its own rotation: TSID's position error is that of the whole pose
        "hand_velocity": np.hstack([[s.hand_velocity[free] for s in setpoints], zeros]),
        "hand_acceleration": np.hstack([[s.hand_acceleration[free] for s in setpoints], zeros]),
        "joint_position": np.array([s.joint_position for s in setpoints]),
        "joint_velocity": joint_velocity,
        "torque_lower": stall * np.clip(-1.0 - share, -1.0, 0.0) - friction,
        "torque_upper": stall * np.clip(1.0 - share, 0.0, 1.0) - friction,
        "acceleration_lower": np.maximum(2.0 * (robot.joint_lower - ahead) / h**2, -2000.0),
        "acceleration_upper": np.minimum(2.0 * (robot.joint_upper - ahead) / h**2, 2000.0),
    }


def _pose(position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """TSID's vector (12,) of a pose: position, then the rotation's columns."""
    return np.concatenate([position, rotation.T.ravel()])


class Server:
    """TSID in its interpreter; a context manager."""

    def __init__(self, ticks: Ticks, folder: Path) -> None:
        self._answer = folder / "answer.npz"
        np.savez(folder / "ticks.npz", **arrays(ticks, MATCHED))
        script = Path(__file__).with_name("tsid_server.py")
        command = [PEERS, "-P", script, ticks.robot.path, folder / "ticks.npz", self._answer]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.sizes = self._read()

    def solve(self, formulation: str, first: int, last: int) -> np.ndarray:
        """Seconds (ticks, 3) of references, problem data and solver of the ticks `first` … `last` − 1."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{formulation} {first} {last}\n")
        self._process.stdin.flush()
        return np.array(self._read())

    def answers(self) -> dict[str, np.ndarray]:
        """Accelerations (ticks, nv) of each formulation, and `least_corner` (ticks,) [N]; the server ends."""
        self._process.communicate()
        with np.load(self._answer) as data:
            return dict(data)

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.kill()
        self._process.wait()

    def _read(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("TSID's server has ended: see its message above, and `make peers`")
        return json.loads(line)


Blocks = dict[str, list[list[float]]]  # seconds of each tick, in blocks


def alternate(ticks: Ticks, server: Server) -> tuple[Blocks, dict[str, list[TorqueCommand]]]:
    """Solve block by block, everyone in turn; a first round warms up and gives the tracker's answers."""
    plain_ticks = plain(ticks)
    trackers = {
        SHIPPED: (Tracker(ticks.robot, TrackerSettings(), step=ticks.step), ticks),
        MATCHING: (Tracker(ticks.robot, MATCHED, step=ticks.step), plain_ticks),
    }
    blocks: Blocks = {}
    commands: dict[str, list[TorqueCommand]] = {name: [] for name in trackers}
    for turn in range(1 + ROUNDS):
        for first in range(0, len(ticks.states), BLOCK):
            seconds = {}
            last = first + BLOCK
            for name, (tracker, asked) in trackers.items():
                pairs = zip(asked.states[first:last], asked.setpoints[first:last], strict=True)
                solved = [tracker.solve(state, setpoint) for state, setpoint in pairs]
                seconds[name] = [command.solve_time for command in solved]
                commands[name] += solved if turn == 0 else []
            for name, formulation in FORMULATIONS.items():
                parts = server.solve(formulation, first, min(last, len(ticks.states)))
                seconds[name] = parts.sum(axis=1).tolist()
                seconds[f"{name}: data and solver"] = parts[:, 1:].sum(axis=1).tolist()
                seconds[f"{name}: solver"] = parts[:, 2].tolist()
            for name, block in seconds.items():
                if turn > 0:
                    blocks.setdefault(name, []).append(block)
    return blocks, commands


def measure() -> Section:
    """Record, alternate, compare."""
    ticks = record()
    with TemporaryDirectory() as folder, Server(plain(ticks), Path(folder)) as server:
        with no_garbage_collection():
            blocks, commands = alternate(ticks, server)
        theirs = server.answers()
    times = Table(("one tick, µs", "p50", "p99", "× the tracker as shipped", "× the tracker on TSID's tasks"))
    for name, kept in blocks.items():
        every = np.concatenate(kept)
        times.rows.append(
            (name, micro(every, 50), micro(every, 99), *(ratio(kept, blocks[ours]) for ours in (SHIPPED, MATCHING)))
        )
    ours = np.array([command.acceleration for command in commands[MATCHING]])
    flat = theirs["least_corner"] > PRESSED
    answers = Table(
        ("accelerations against the tracker on TSID's tasks", "ticks", "p50", "largest", "within tolerance")
    )
    for name, formulation in FORMULATIONS.items():
        error = np.linalg.norm(theirs[formulation] - ours, axis=1) / np.linalg.norm(ours, axis=1)
        for which, those in ((name, error), (f"{name}, all corners pressing", error[flat])):
            if len(those):
                share = f"{100.0 * np.mean(those < TOLERANCE):.0f} %"
                row = (which, str(len(those)), f"{np.median(those):.0e}", f"{those.max():.0e}", share)
                answers.rows.append(row)
    sizes = "{variables} variables, {equalities} equations, {rows} inequalities".format(**server.sizes)
    return Section(
        "tracker",
        "The tracker against TSID",
        [times, answers],
        [NOTE.format(sizes=sizes, ticks=len(ticks.states), tolerance=TOLERANCE)],
    )
