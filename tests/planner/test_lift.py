"""The life of a lift against palms that follow it, and a box that a stiff law of contact stands for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.lift import GAP, GRIP_MARGIN, LEAST_SQUEEZE, Lift, LiftPhase
from wbmpc.rotations import level_frame
from wbmpc.scenario import LiftTask, Load
from wbmpc.signals import GRAVITY, HandMode, Vector

DT, RADIUS = 0.01, 0.015
HOMES = np.array([[0.03, 0.115, 0.23], [0.03, -0.115, 0.23]])
CENTRE, HALF = np.array([0.16, 0.01, 0.06]), np.array([0.04, 0.08, 0.06])
TASK = LiftTask(kind="lift", object="thing", height=0.1, start=0.3, reach_time=1.0, raise_time=1.0)


class Bench:
    """Palms where the references are; a box whose faces push back, and which weighs on palms that have raised it."""

    def __init__(self, *, mass: float = 0.2, told: float = 0.2, yaw: float = 0.0, heading: float = 0.0) -> None:
        self.turn = level_frame(heading)
        load = Load(task=TASK, centre=self.turn @ CENTRE, half=HALF, yaw=heading + yaw, mass=told)
        self.homes = HOMES @ self.turn.T
        self.lift = Lift(load, palms=self.homes, heading=heading, palm_radius=RADIUS)
        self.on_faces, self.normals = self.lift.grasp.copy(), self.lift.normals.copy()
        self.mass, self.time, self.palms, self.present = mass, 0.0, self.homes.copy(), True
        self.phases: list[LiftPhase] = []

    def step(self) -> None:
        forces = np.zeros((2, 3))
        if self.present and self.lift.holds:
            forces = self.lift.forces(np.zeros(1))[:, 0]
            if self.lift.raised:
                forces[:, 2] = -0.5 * self.mass * GRAVITY
        elif self.present:
            depth = np.einsum("si,si->s", self.on_faces - self.palms, self.normals)
            forces = np.maximum(1000.0 * depth, 0.0)[:, None] * self.normals
        self.lift.advance(self.time, DT, palms=self.palms, palm_forces=forces, homes=self.homes)
        self.time += DT
        self.phases.append(self.lift.phase)
        if self.lift.active:
            self.palms = np.array([self.lift.reference(side)[0] for side in range(2)])

    def run(self, seconds: float) -> Bench:
        for _ in range(round(seconds / DT)):
            self.step()
        return self


def in_order(phases: list[LiftPhase]) -> list[LiftPhase]:
    return [phase for i, phase in enumerate(phases) if i == 0 or phase != phases[i - 1]]


@settings(max_examples=15, deadline=None)
@given(heading=st.floats(-3.0, 3.0), yaw=st.floats(-0.6, 0.6))
def test_it_takes_the_box_between_the_faces_across_its_heading_and_raises_it(heading: float, yaw: float) -> None:
    bench = Bench(heading=heading, yaw=yaw)
    left = level_frame(heading)[:, 1]
    assert bench.normals[0] @ left > 0.8
    assert_allclose(bench.normals[1], -bench.normals[0])
    middle = bench.on_faces.mean(axis=0)
    assert_allclose(middle[:2], (bench.turn @ CENTRE)[:2], atol=1e-12)
    assert CENTRE[2] < middle[2] < CENTRE[2] + HALF[2]  # held above its centre it hangs
    assert np.linalg.norm(bench.on_faces[0] - bench.on_faces[1]) == pytest.approx(2 * (HALF[1] + RADIUS))
    bench.run(5.0)
    expected = ["WAIT", "REACH", "CLOSE", "GRIP", "RAISE", "CARRY"]
    assert [phase.name for phase in in_order(bench.phases)] == expected
    assert_allclose(bench.palms, bench.lift.grasp + np.array([0.0, 0.0, TASK.height]), atol=1e-9)
    assert_allclose(bench.lift.grasp, bench.on_faces, atol=2e-3)  # where it felt the faces
    assert bench.lift.mode == HandMode.CARRY


def test_the_palms_come_from_outside_and_close_slowly() -> None:
    bench = Bench()
    while bench.lift.phase != LiftPhase.GRIP:
        before = bench.palms
        bench.step()
        outside = np.einsum("si,si->s", bench.palms - bench.on_faces, bench.normals)
        if bench.lift.phase == LiftPhase.REACH and np.abs(bench.palms[0, 2] - bench.on_faces[0, 2]) < HALF[2] / 2:
            assert (outside > 0.5 * GAP).all()
        if bench.lift.phase == LiftPhase.CLOSE and bench.time > 1.5:
            assert np.linalg.norm(bench.palms - before, axis=1).max() <= 0.05 * DT + 1e-9


def test_forces_squeeze_along_the_hands_and_carry_the_weight() -> None:
    bench = Bench().run(2.05)
    assert bench.lift.phase == LiftPhase.GRIP
    previews = bench.lift.forces(np.arange(0.0, 2.0, DT))
    squeeze = np.einsum("sni,si->sn", previews, bench.lift.normals)
    assert (np.diff(squeeze, axis=1) >= -1e-12).all()
    assert (np.diff(previews[:, :, 2], axis=1) <= 1e-12).all()
    assert (previews[:, squeeze[0] < 0.99 * squeeze.max(), 2] == 0.0).all()  # first the grip, then the weight
    bench.run(2.0)
    forces = bench.lift.forces(np.zeros(1))[:, 0]
    assert_allclose(forces.sum(axis=0), [0.0, 0.0, -0.2 * GRAVITY], atol=1e-4)
    squeeze_now = float(forces[0] @ bench.lift.normals[0])
    assert squeeze_now == pytest.approx(max(LEAST_SQUEEZE, GRIP_MARGIN * 0.1 * GRAVITY / TASK.friction))


@settings(max_examples=10, deadline=None)
@given(mass=st.floats(0.1, 0.75), told=st.floats(0.16, 0.5))
def test_the_weight_is_felt_and_the_grip_is_never_loosened_below_what_was_told(mass: float, told: float) -> None:
    bench = Bench(mass=mass, told=told).run(6.0)
    forces = bench.lift.forces(np.zeros(1))[:, 0]
    assert_allclose(-forces[:, 2].sum(), mass * GRAVITY, rtol=1e-3)
    needed = 0.5 * max(mass, told) * GRAVITY / TASK.friction
    assert float(forces[0] @ bench.lift.normals[0]) > 1.35 * needed


@pytest.mark.parametrize("seconds", [0.8, 1.4, 2.1, 2.9, 3.8])
def test_the_preview_is_what_the_reference_will_be(seconds: float) -> None:
    bench = Bench().run(seconds)
    phase, ahead = bench.lift.phase, np.array([0.0, 0.05, 0.1])
    preview = bench.lift.preview(ahead)
    seen: list[Vector] = []
    for _ in range(11):
        seen.append(np.array([bench.lift.reference(side)[0] for side in range(2)]))
        velocity = np.array([bench.lift.reference(side)[1] for side in range(2)])
        bench.step()
        if bench.lift.phase != phase:
            pytest.fail("a phase ended in between")
        if phase in (LiftPhase.REACH, LiftPhase.RAISE):
            now = np.array([bench.lift.reference(side)[0] for side in range(2)])
            assert_allclose((now - seen[-1]) / DT, velocity, atol=0.02)
    if phase != LiftPhase.CLOSE:  # what is sought cannot be foreseen
        assert_allclose(preview[:, [0, 1, 2]], np.array(seen)[[0, 5, 10]].transpose(1, 0, 2), atol=1e-9)


def test_where_there_is_no_box_it_gives_up_and_goes_home() -> None:
    bench = Bench()
    bench.present = False
    bench.run(6.0)
    assert [phase.name for phase in in_order(bench.phases)][-3:] == ["CLOSE", "GIVE_UP", "DONE"]
    assert_allclose(bench.palms, bench.homes, atol=2e-3)
    assert not bench.lift.forces(np.zeros(3)).any()
    assert not bench.lift.ahead


def test_a_box_that_slips_away_is_not_carried_on() -> None:
    bench = Bench().run(4.0)
    assert bench.lift.raised
    bench.present = False
    bench.run(0.5)
    assert bench.lift.phase == LiftPhase.GIVE_UP
    assert not bench.lift.forces(np.zeros(1)).any()


def test_palms_that_cannot_come_near_give_up() -> None:
    bench = Bench()
    for _ in range(600):
        bench.step()
        bench.palms = bench.palms + np.array([0.0, 0.0, 0.03])
    assert LiftPhase.CLOSE not in bench.phases
    assert LiftPhase.GIVE_UP in bench.phases


def test_the_feet_stay_until_the_box_is_up() -> None:
    bench = Bench()
    assert bench.lift.hold_feet  # before it has begun as well
    stayed = []
    for _ in range(600):
        bench.step()
        stayed.append((bench.lift.phase, bench.lift.hold_feet))
    assert stayed[-1][0] == LiftPhase.CARRY
    assert all(held == (phase != LiftPhase.CARRY) for phase, held in stayed)


def test_when_the_feet_set_out_the_box_goes_with_the_com_without_a_jump() -> None:
    bench = Bench().run(6.0)
    lift, com = bench.lift, np.zeros((3, 3))
    com[:, 0] = [0.02, 0.0, 0.25]
    before = np.array([lift.reference(side)[0] for side in range(2)])
    course = np.tile(com[:, 0], (5, 1)) + 0.01 * np.arange(5)[:, None] * [1.0, 0.0, 0.0]
    lift.go_along(com, course, heading=0.0, yaw_rate=0.0)
    assert_allclose([lift.reference(side)[0] for side in range(2)], before, atol=1e-12)
    assert_allclose(
        lift.preview(np.zeros(5)) - lift.preview(np.zeros(5))[:, :1], (course - course[0])[None].repeat(2, 0)
    )
    com[:, 0] += [0.05, 0.04, 0.02]
    com[:, 1] = [0.1, 0.0, 0.0]
    lift.go_along(com, course, heading=0.0, yaw_rate=0.0)
    for side in range(2):
        position, velocity = lift.reference(side)
        assert_allclose(position - before[side], [0.05, 0.04, 0.02], atol=1e-12)
        assert_allclose(velocity, [0.1, 0.0, 0.0])
    assert_allclose(lift.grasp - before, np.tile([0.05, 0.04, 0.02], (2, 1)), atol=1e-12)
    assert lift.progress == 0.0


def test_before_the_box_is_up_nothing_goes_along() -> None:
    bench = Bench().run(1.0)
    bench.lift.go_along(np.zeros((3, 3)), np.zeros((5, 3)), heading=0.0, yaw_rate=0.0)
    assert bench.lift.carry is None


def test_a_box_that_is_lost_on_the_way_is_given_up_where_the_palms_are() -> None:
    bench = Bench().run(6.0)
    com = np.zeros((3, 3))
    bench.lift.go_along(com, np.zeros((5, 3)), heading=0.0, yaw_rate=0.0)
    bench.present = False
    for _ in range(100):
        bench.lift.advance(bench.time, DT, palms=bench.palms, palm_forces=np.zeros((2, 3)), homes=bench.homes)
        bench.time += DT
    assert bench.lift.phase == LiftPhase.GIVE_UP
    assert bench.lift.carry is None
