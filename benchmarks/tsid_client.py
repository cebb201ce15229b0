"""This project's side of TSID's server: what TSID is told of every tick, and the process."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.braced_states import Ticks
from wbmpc.kinematics import Kinematics
from wbmpc.tracker.settings import TrackerSettings

ROOT = Path(__file__).parents[1]
PEERS = ROOT / ".venv-peers" / "bin" / "python"  # made by `make peers`
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


def peers_python() -> str:
    """The interpreter of the peers' environment. Raises SystemExit when there is none."""
    if not PEERS.exists():
        raise SystemExit("the peers of this benchmark are not installed: `make peers` installs them")
    return str(PEERS)


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
        command = [peers_python(), "-P", str(Path(__file__).with_name("tsid_server.py"))]
        np.savez(folder / "ticks.npz", **arrays(ticks, MATCHED))
        command += map(str, (ticks.robot.path, folder / "ticks.npz", self._answer))
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
