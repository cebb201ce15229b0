"""Velocities and Jacobians of frames from Pinocchio's joint screws, and how far they are turned, as machine code."""

from __future__ import annotations

from math import atan2, cos, pi, sin, sqrt

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbmpc.jit import short_kernel


def chains_of(model: pin.Model, frames: tuple[int, ...]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Velocity coordinates that move each frame, from the base out, padded (frames, longest), and how many."""
    chains = []
    for frame in frames:
        joints = list(model.supports[model.frames[frame].parentJoint])[1:]  # without the universe
        chains.append([model.idx_vs[j] + i for j in joints for i in range(model.nvs[j])])
    lengths = np.array([len(chain) for chain in chains])
    padded = np.zeros((len(frames), int(lengths.max())), dtype=np.int64)
    for row, chain in zip(padded, chains, strict=True):
        row[: len(chain)] = chain
    return padded, lengths


@short_kernel
def rotation_of(poses, frame):  # type: ignore[no-untyped-def]
    """Rotation (3, 3) of a frame to world out of `Kinematics.views`' poses."""
    return poses[frame, :3].T


@short_kernel
def frame_twists(J, v, chains, lengths, positions, twist):  # type: ignore[no-untyped-def]
    """Write the twists (frames, 6) at the frames' origins in world axes; see `frame_terms`."""
    for f in range(lengths.size):
        px, py, pz = positions[f][0], positions[f][1], positions[f][2]
        ux = uy = uz = wx = wy = wz = 0.0  # about the world's origin
        for c in range(lengths[f]):
            k = chains[f, c]
            s = v[k]
            ux, uy, uz = ux + s * J[0, k], uy + s * J[1, k], uz + s * J[2, k]
            wx, wy, wz = wx + s * J[3, k], wy + s * J[4, k], wz + s * J[5, k]
        twist[f, 0], twist[f, 1], twist[f, 2] = ux + wy * pz - wz * py, uy + wz * px - wx * pz, uz + wx * py - wy * px
        twist[f, 3], twist[f, 4], twist[f, 5] = wx, wy, wz


@short_kernel
def frame_terms(J, v, chains, lengths, positions, jacobian, twist, drift):  # type: ignore[no-untyped-def]
    """Write Jacobians (f, 6, nv), twists (f, 6) and J̇v (f, 6) of f frames, at their origins in world axes.

    Column k of `J` (6, nv) is the screw of coordinate k about the world's origin. It moves with the body before it:
    its rate is that body's twist × the screw. `chains` lists the coordinates that move a frame, the base's six first.
    """
    jacobian[:] = 0.0
    for f in range(lengths.size):
        px, py, pz = positions[f][0], positions[f][1], positions[f][2]
        ux = uy = uz = wx = wy = wz = 0.0  # twist about the world's origin
        ax = ay = az = bx = by = bz = 0.0  # its rate at v̇ = 0
        for c in range(lengths[f]):
            k = chains[f, c]
            lx, ly, lz, rx, ry, rz = J[0, k], J[1, k], J[2, k], J[3, k], J[4, k], J[5, k]
            jacobian[f, 0, k] = lx + ry * pz - rz * py
            jacobian[f, 1, k] = ly + rz * px - rx * pz
            jacobian[f, 2, k] = lz + rx * py - ry * px
            jacobian[f, 3, k], jacobian[f, 4, k], jacobian[f, 5, k] = rx, ry, rz
            s = v[k]
            if k >= 6:
                ax += s * (wy * lz - wz * ly + uy * rz - uz * ry)
                ay += s * (wz * lx - wx * lz + uz * rx - ux * rz)
                az += s * (wx * ly - wy * lx + ux * ry - uy * rx)
                bx += s * (wy * rz - wz * ry)
                by += s * (wz * rx - wx * rz)
                bz += s * (wx * ry - wy * rx)
            ux, uy, uz = ux + s * lx, uy + s * ly, uz + s * lz
            wx, wy, wz = wx + s * rx, wy + s * ry, wz + s * rz
        tx, ty, tz = ux + wy * pz - wz * py, uy + wz * px - wx * pz, uz + wx * py - wy * px
        twist[f, 0], twist[f, 1], twist[f, 2] = tx, ty, tz
        twist[f, 3], twist[f, 4], twist[f, 5] = wx, wy, wz
        drift[f, 0] = ax + by * pz - bz * py + wy * tz - wz * ty
        drift[f, 1] = ay + bz * px - bx * pz + wz * tx - wx * tz
        drift[f, 2] = az + bx * py - by * px + wx * ty - wy * tx
        drift[f, 3], drift[f, 4], drift[f, 5] = bx, by, bz


@short_kernel
def frame_rows(J, chain, length, at, out):  # type: ignore[no-untyped-def]
    """Write a frame's Jacobian into `out`, which is zero: (3, nv) of its origin `at` (3,), or (6, nv) with turning.

    `chain` (length,) lists the coordinates that move the frame; `J` as in `frame_terms`.
    """
    for c in range(length):
        k = chain[c]
        rx, ry, rz = J[3, k], J[4, k], J[5, k]
        out[0, k] = J[0, k] + ry * at[2] - rz * at[1]
        out[1, k] = J[1, k] + rz * at[0] - rx * at[2]
        out[2, k] = J[2, k] + rx * at[1] - ry * at[0]
        if len(out) == 6:
            out[3, k], out[4, k], out[5, k] = rx, ry, rz


@short_kernel
def turn_to_level(yaw, R, out):  # type: ignore[no-untyped-def]
    """Write the rotation vector (3,) in world that turns `R` (3, 3) into `level_frame(yaw)`; see `rotation_error`."""
    c, s = cos(yaw), sin(yaw)
    E = np.empty((3, 3))
    for j in range(3):
        E[0, j] = c * R[j, 0] - s * R[j, 1]
        E[1, j] = s * R[j, 0] + c * R[j, 1]
        E[2, j] = R[j, 2]
    out[0], out[1], out[2] = E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]
    sine = 0.5 * sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    cosine = 0.5 * (E[0, 0] + E[1, 1] + E[2, 2] - 1.0)
    if sine >= 1e-9:
        scale = 0.5 * atan2(sine, cosine) / sine
        for i in range(3):
            out[i] *= scale
    elif cosine > 0.0:
        for i in range(3):
            out[i] *= 0.5
    else:  # E + 1 = 2 a aᵀ for a half turn about a
        for i in range(3):
            E[i, i] += 1.0
        longest = 0
        for i in range(1, 3):
            if E[i, i] > E[longest, longest]:
                longest = i
        length = sqrt(E[0, longest] ** 2 + E[1, longest] ** 2 + E[2, longest] ** 2)
        for i in range(3):
            out[i] = pi * E[i, longest] / length
