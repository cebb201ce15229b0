"""What is drawn over the robot: against the frame, in a scene without a window."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from numpy.testing import assert_allclose

from wbmpc.interact.exchange import Frame
from wbmpc.interact.overlay import Line, Shape, draw, shapes_of
from wbmpc.scenario import PatchPose

SLOPE = np.array([0.0, -0.6, 0.8])
PATCHES = tuple(
    PatchPose(name, "table", np.array([0.3, y, 0.2]), normal, 0.5, 20.0)
    for name, y, normal in (("near", 0.1, np.array([0.0, 0.0, 1.0])), ("far", -0.1, SLOPE))
)
FRAME = Frame(
    qpos=np.zeros(7),
    qvel=np.zeros(6),
    control=np.zeros(0),
    com=np.linspace([0, 0, 0.3], [0.1, 0, 0.3], 5),
    zmp=np.vstack([np.zeros((4, 3)), np.full((1, 3), np.nan)]),
    support=np.array([[0.1, 0.1, 0], [-0.1, 0.1, 0], [-0.1, -0.1, 0], [0.1, -0.1, 0]], float),
    targets=np.array([[0.4, 0.0, 0.3], [0.3, 0.2, 0.3]]),
    chosen=1,
    patches=("far",),
    plan_shown=True,
    caption=("", ""),
)


def test_everything_is_where_the_frame_says() -> None:
    shapes = list(shapes_of(FRAME, PATCHES))
    spheres, boxes = (
        [s for s in shapes if isinstance(s, Shape) and s.kind == kind]
        for kind in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX)
    )
    lines = [s for s in shapes if isinstance(s, Line)]
    assert_allclose([s.position for s in spheres], FRAME.targets)
    assert spheres[1].size[0] > spheres[0].size[0]
    assert_allclose([s.position for s in boxes], [p.position for p in PATCHES], atol=0.003)
    for box, patch in zip(boxes, PATCHES, strict=True):
        assert_allclose(box.rotation @ box.rotation.T, np.eye(3), atol=1e-12)
        assert_allclose(box.rotation[:, 2], patch.normal, atol=1e-12)
    assert boxes[1].rgba[3] > boxes[0].rgba[3]
    assert len(lines) == 4 + 4  # the CoM's way and the closed polygon; a ZMP that stays, or is nan, is no line
    assert_allclose(lines[-1].end, FRAME.support[0])


def test_a_hidden_plan_leaves_the_targets() -> None:
    assert len(list(shapes_of(replace(FRAME, plan_shown=False), PATCHES))) == 2


def test_the_scene_takes_what_it_has_room_for() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='.1'/></worldbody></mujoco>")
    scene = mujoco.MjvScene(model, 6)
    draw(scene, shapes_of(FRAME, PATCHES))
    assert scene.ngeom == 6
    assert_allclose(scene.geoms[1].pos, FRAME.targets[1], atol=1e-6)
    draw(scene, shapes_of(replace(FRAME, plan_shown=False, targets=FRAME.targets[:1]), ()))
    assert scene.ngeom == 1
