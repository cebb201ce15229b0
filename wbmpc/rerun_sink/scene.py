"""The 3D scene: one static shape for each visible geom of the compiled model, one stream of poses for each body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wbmpc.rerun_sink.glyphs import drawable
from wbmpc.rerun_sink.palette import LIMIT
from wbmpc.rerun_sink.stream import Stream

_FIRST_HIDDEN_GROUP = 3  # MuJoCo's own viewer shows geom groups 0 to 2; the rest is for collision only
_PLANE_HALF_SIZE = 1.5  # [m] drawn for a plane without limits
_DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)  # what MuJoCo gives a geom without a colour of its own
_XYZW = [1, 2, 3, 0]  # MuJoCo's wxyz -> rerun's xyzw


@dataclass(frozen=True, slots=True)
class Patch:
    """A candidate contact patch as drawn: a rectangle."""

    name: str
    corners: NDArray[np.float64]  # (4, 3) [m] in world, in order around the patch
    normal: NDArray[np.float64]  # (3,) out of the surface
    friction: float = 0.5  # coefficient that the planner counts on

    @property
    def centre(self) -> NDArray[np.float64]:
        """(3,) [m] in world."""
        centre: NDArray[np.float64] = np.mean(self.corners, axis=0)
        return centre

    @property
    def frame(self) -> NDArray[np.float64]:
        """(3, 3) rotation to world whose columns are the directions of two edges, and the normal."""
        first = self.corners[1] - self.corners[0]
        first = first / np.linalg.norm(first)
        return np.column_stack([first, np.cross(self.normal, first), self.normal])

    def half_size(self, thickness: float) -> NDArray[np.float64]:
        """(3,) [m] half extents in its frame of a plate of that thickness."""
        edges = self.corners[1] - self.corners[0], self.corners[2] - self.corners[1]
        return np.array([*(0.5 * np.linalg.norm(edge) for edge in edges), 0.5 * thickness])


class Scene:
    """Draws one model; keeps its own MjData for the poses, so that the run's state is never touched."""

    def __init__(self, stream: Stream, model: Any, patches: Sequence[Patch]) -> None:
        self._stream, self._model = stream, model
        self._data = mujoco.MjData(model)
        self._paths = {
            body: f"/world/bodies/{_part(model.body(body).name or f'body_{body}')}" for body in range(1, model.nbody)
        }
        stream.static("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for geom in range(model.ngeom):
            if model.geom_group[geom] < _FIRST_HIDDEN_GROUP:
                self._draw_geom(geom)
        for patch in patches:
            self._draw_patch(patch)

    def write_poses(self, time: NDArray[np.float64], qpos: NDArray[np.float64]) -> None:
        """World poses of all bodies at `time` (n,) [s] from `qpos` (n, nq)."""
        model, data = self._model, self._data
        position = np.empty((model.nbody, len(time), 3), np.float32)  # as in the file, where each body has its own rows
        quaternion = np.empty((model.nbody, len(time), 4), np.float32)
        for row, q in enumerate(qpos):
            data.qpos[: len(q)] = q
            mujoco.mj_kinematics(model, data)
            position[:, row], quaternion[:, row] = data.xpos, data.xquat
        quaternion = quaternion[:, :, _XYZW]
        for body, path in self._paths.items():
            self._stream.poses(path, time, position[body], quaternion[body])

    def _draw_geom(self, geom: int) -> None:
        model = self._model
        shape = _shape(model, geom)
        if shape is None:
            return
        kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        parent = self._paths.get(int(model.geom_bodyid[geom]), "/world/static")
        pose = rr.Transform3D(translation=model.geom_pos[geom], quaternion=model.geom_quat[geom][_XYZW])
        self._stream.static(f"{parent}/{_part(model.geom(geom).name or f'{kind}_{geom}')}", pose, shape)

    def _draw_patch(self, patch: Patch) -> None:
        outline = np.vstack([patch.corners, patch.corners[:1]]) + 1e-3 * patch.normal  # off the surface, or it flickers
        path = f"/world/patches/{_part(patch.name)}"
        label = {"labels": [drawable(patch.name)], "show_labels": False}  # on hover: a dozen would hide the robot
        self._stream.static(path, rr.LineStrips3D([outline], colors=[LIMIT], radii=0.0015, **label))
        normal = rr.Arrows3D(origins=[patch.centre], vectors=[0.03 * patch.normal], colors=[LIMIT], radii=0.0015)
        self._stream.static(f"{path}/normal", normal)


def _part(name: str) -> str:
    escaped: str = rr.escape_entity_path_part(drawable(name))
    return escaped


def geom_rgba(model: Any, geom: int) -> NDArray[np.float64]:
    """(4,) plain colour of a geom: its own when it has one, else its material's, times the texture's mean."""
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    rgba = model.mat_rgba[material] if material >= 0 and np.allclose(own, _DEFAULT_RGBA) else own
    rgba = np.array(rgba, dtype=float)
    if material >= 0:
        rgba[:3] *= _mean_texture(model, material)
    return rgba


def _mean_texture(model: Any, material: int) -> NDArray[np.float64]:
    """(3,) mean colour of a material's texture: the recording shows plain colours."""
    texture = int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])
    if texture < 0:
        return np.ones(3)
    start, channels = int(model.tex_adr[texture]), int(model.tex_nchannel[texture])
    count = int(model.tex_width[texture]) * int(model.tex_height[texture])
    texels = model.tex_data[start : start + count * channels].reshape(count, channels)
    return np.resize(texels.mean(axis=0), 3) / 255  # one grey channel stands for all three


def _shape(model: Any, geom: int) -> Any | None:
    """The archetype of a geom in its own frame; None for kinds without a counterpart (height fields, SDFs)."""
    kind, size = mujoco.mjtGeom(model.geom_type[geom]), np.asarray(model.geom_size[geom], dtype=float)
    rgba = np.round(255 * geom_rgba(model, geom)).astype(np.uint8)
    solid: dict[str, Any] = {"colors": [rgba], "fill_mode": rr.components.FillMode.Solid}
    match kind:
        case mujoco.mjtGeom.mjGEOM_BOX:
            return rr.Boxes3D(half_sizes=[size], **solid)
        case mujoco.mjtGeom.mjGEOM_PLANE:
            half = np.where(size[:2] > 0, size[:2], _PLANE_HALF_SIZE)
            return rr.Boxes3D(half_sizes=[[*half, 5e-4]], centers=[[0, 0, -5e-4]], **solid)
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return rr.Ellipsoids3D(half_sizes=[[size[0]] * 3], **solid)
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return rr.Ellipsoids3D(half_sizes=[size], **solid)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:  # rerun's starts at its origin, MuJoCo's is centred
            return rr.Capsules3D(lengths=[2 * size[1]], radii=[size[0]], translations=[[0, 0, -size[1]]], **solid)
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return rr.Cylinders3D(lengths=[2 * size[1]], radii=[size[0]], **solid)
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.mesh(int(model.geom_dataid[geom]))
            vertices = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
            faces = model.mesh_face[mesh.faceadr[0] : mesh.faceadr[0] + mesh.facenum[0]]
            return rr.Mesh3D(vertex_positions=vertices, triangle_indices=faces, albedo_factor=rgba)
    return None
