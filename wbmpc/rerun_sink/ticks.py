"""Columns of the 1 kHz ticks, thinned to the recording's rate: state, forces, errors, torques."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.palette import AXES, FAULT, LEFT, LIMIT, MEASURED, PLANNED, RIGHT
from wbmpc.rerun_sink.stream import Colour, Ragged, Stream, worst_since_last
from wbmpc.signals import SIDES, HandMode, SolveStatus

FELL_BACK = ", fallback"
CONTACT_GEOMS = "/contacts/geoms"  # who touches whom: pairs of MuJoCo's geom ids, one after another
_HANDS = (LEFT, RIGHT)


def describe_ticks(stream: Stream, joint_names: Sequence[str]) -> None:
    """Names, colours and sizes of everything that `write_ticks` sends."""
    for axis in "xyz":
        stream.series(f"/com/{axis}", ["CoM measured", "CoM planned"], [MEASURED, PLANNED])
    for axis in "xy":
        stream.series(f"/zmp/{axis}/measured", ["ZMP measured"], [MEASURED])
    stream.series("/tracking/com_error", ["CoM x [mm]", "CoM y [mm]", "CoM z [mm]"], AXES)
    stream.series("/tracking/palm_error", [f"{side} palm [mm]" for side in SIDES], _HANDS)
    stream.series("/tracking/base", ["torso up (1: upright)"], [MEASURED])
    for side in SIDES:
        stream.series(f"/contacts/{side}_hand", ["sensed [N]", "planned [N]", "cap [N]"], [MEASURED, PLANNED, LIMIT])
        stream.series(f"/contacts/{side}_foot", ["sensed fz [N]", "commanded fz [N]"], [MEASURED, PLANNED])
    stream.series("/contacts/penetration", ["deepest penetration [mm]"], [FAULT])
    colours = _hues(len(joint_names))
    for quantity in ("torque", "torque_limit", "torque_share", "velocity", "posture_error"):
        stream.series(f"/joints/{quantity}", joint_names, colours, width=1.0)
    stream.series("/solvers/tracker", ["tracker"], [MEASURED])

    stream.static("/world/com/measured", rr.Points3D.from_fields(radii=0.012, colors=[MEASURED]))
    stream.static("/world/com/planned", rr.Points3D.from_fields(radii=0.010, colors=[PLANNED]))
    stream.static("/world/com/plumb_line", rr.LineStrips3D.from_fields(radii=0.001, colors=[MEASURED]))
    stream.static("/world/zmp/measured", rr.Points3D.from_fields(radii=0.007, colors=[MEASURED]))
    stream.static("/world/contacts", rr.Arrows3D.from_fields(radii=0.0025, colors=[MEASURED]))
    stream.static("/world/disturbance", rr.Arrows3D.from_fields(radii=0.006, colors=[FAULT]))
    for side, colour in zip(SIDES, _HANDS, strict=True):
        stream.static(f"/world/hands/{side}/reference", rr.Points3D.from_fields(radii=0.010, colors=[colour]))
        stream.static(f"/world/hands/{side}/planned_force", rr.Arrows3D.from_fields(radii=0.004, colors=[PLANNED]))


def write_ticks(stream: Stream, recorder: Recorder, rows: NDArray[np.int64], stride: int) -> None:
    """Send the ticks `rows`, every `stride`-th of the run."""
    time = recorder.time[rows]
    stream.scalars("/state/qpos", time, recorder.qpos[rows])
    stream.scalars("/state/qvel", time, recorder.qvel[rows])
    _write_balance(stream, recorder, rows, time)
    _write_hands_and_feet(stream, recorder, rows, time)
    _write_contacts(stream, recorder, rows, time)
    _write_joints(stream, recorder, rows, time)
    # Each sample carries the worst tick since the one before: thinning must not hide a slow solve.
    stream.scalars("/solvers/tracker", time, 1e3 * worst_since_last(recorder.command_solve_time, rows, stride))


def write_tracker_status(stream: Stream, recorder: Recorder, since: int, until: int) -> None:
    """Send the changes of the tracker's status over all ticks in since … until: thinning must not hide a failure."""
    status, fallback = recorder.command_status[since:until], recorder.command_fallback[since:until]
    changed = np.ones(len(status), dtype=bool)
    changed[1:] = (status[1:] != status[:-1]) | (fallback[1:] != fallback[:-1])
    names = [
        SolveStatus(s).name + (FELL_BACK if f else "") for s, f in zip(status[changed], fallback[changed], strict=True)
    ]
    stream.states("/solver_status/tracker", recorder.time[since:until][changed], names)


def _write_balance(stream: Stream, recorder: Recorder, rows: NDArray[np.int64], time: NDArray[np.float64]) -> None:
    com, zmp, planned = recorder.com[rows], recorder.zmp[rows], recorder.setpoint_com_position[rows // recorder.stride]
    for i, axis in enumerate("xyz"):
        stream.scalars(f"/com/{axis}", time, np.column_stack([com[:, i], planned[:, i]]))
    for i, axis in enumerate("xy"):
        stream.scalars(f"/zmp/{axis}/measured", time, zmp[:, i])
    stream.scalars("/tracking/com_error", time, 1e3 * (com - planned))
    stream.scalars("/tracking/base", time, recorder.torso_up[rows])
    ground = recorder.sole_position[rows, :, 2].min(axis=1)
    floor_point = np.column_stack([com[:, :2], ground])
    stream.points("/world/com/measured", time, com)
    stream.points("/world/com/planned", time, planned)
    ends = np.hstack([com, floor_point]).reshape(-1, 3)
    stream.lines("/world/com/plumb_line", time, ends, np.full(len(time), 2))
    stream.points("/world/zmp/measured", time, np.column_stack([zmp, ground]))
    push = recorder.external_force[rows]
    pushed = np.any(push != 0, axis=1)
    stream.force_arrows("/world/disturbance", time, com[pushed], push[pushed], pushed.astype(int))


def _write_hands_and_feet(
    stream: Stream, recorder: Recorder, rows: NDArray[np.int64], time: NDArray[np.float64]
) -> None:
    samples = rows // recorder.stride
    palm, reference = recorder.palm_position[rows], recorder.setpoint_hand_position[samples]
    guided = (recorder.setpoint_hand_mode[samples] != HandMode.FREE)[:, :, None]
    reference = np.where(guided, reference, np.nan)
    stream.scalars("/tracking/palm_error", time, 1e3 * np.linalg.norm(palm - reference, axis=2))
    sensed, planned = recorder.state_palm_force_in_world[samples], recorder.setpoint_hand_force[samples]
    cap = recorder.setpoint_hand_force_cap[samples]
    sole, command = recorder.state_sole_wrench_in_world[samples], recorder.command_sole_wrench_in_world[samples]
    for i, side in enumerate(SIDES):
        norms = [np.linalg.norm(force[:, i], axis=1) for force in (sensed, planned)]
        stream.scalars(f"/contacts/{side}_hand", time, np.column_stack([*norms, cap[:, i]]))
        stream.scalars(f"/contacts/{side}_foot", time, np.column_stack([sole[:, i, 2], command[:, i, 2]]))
        stream.points(f"/world/hands/{side}/reference", time, reference[:, i])
        loaded = norms[1] > 0
        stream.force_arrows(
            f"/world/hands/{side}/planned_force", time, palm[loaded, i], planned[loaded, i], loaded.astype(int)
        )


def _write_contacts(stream: Stream, recorder: Recorder, rows: NDArray[np.int64], time: NDArray[np.float64]) -> None:
    contacts, counts = recorder.contacts_of(rows), recorder.contact_count[rows]
    stream.force_arrows("/world/contacts", time, contacts.position, contacts.force, counts)
    stream.values(CONTACT_GEOMS, time, geoms=Ragged(contacts.geoms.ravel(), 2 * counts))
    deepest = np.zeros(len(rows))
    np.maximum.at(deepest, np.repeat(np.arange(len(rows)), counts), -1e3 * contacts.distance)
    stream.scalars("/contacts/penetration", time, deepest)
    stream.scalars("/contacts/count", time, counts)


def _write_joints(stream: Stream, recorder: Recorder, rows: NDArray[np.int64], time: NDArray[np.float64]) -> None:
    torque, limit, samples = recorder.torque[rows], recorder.torque_limit[rows], rows // recorder.stride
    # The robot's own joints end the robot's part of q and v, whatever else the world holds.
    position, velocity = (recorder.column(name)[samples][:, -torque.shape[1] :] for name in ("state_q", "state_v"))
    stream.scalars("/joints/torque", time, torque)
    stream.scalars("/joints/torque_limit", time, limit)
    stream.scalars("/joints/torque_share", time, np.abs(torque) / np.maximum(np.abs(limit), 1e-9))
    stream.scalars("/joints/velocity", time, velocity)
    stream.scalars("/joints/posture_error", time, position - recorder.setpoint_joint_position[samples])


def _hues(count: int) -> list[Colour]:
    """Distinguishable colours around the colour circle."""
    phases = np.arange(count)[:, None] * 0.381966 + np.array([0.0, 1 / 3, 2 / 3])  # golden section: neighbours differ
    return [tuple(int(c) for c in row) for row in 140 + 100 * np.cos(2 * np.pi * phases)]  # type: ignore[misc]
