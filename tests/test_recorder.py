"""The recorder gives back what it was given, whatever the number of ticks and contacts."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wbmpc.columns import EVERY_TICK, SAMPLED
from wbmpc.recorder import Recorder
from wbmpc.signals import CONTACT, MAX_CONTACTS, RobotState, Setpoint, SolveStatus, StageReport, TorqueCommand, Truth
from wbmpc.signals import PlanReport as Plan


@dataclass(frozen=True)
class Dimensions:
    nq: int = 9
    nv: int = 8
    nj: int = 2


def random_signal(cls: type, rng: np.random.Generator, **given_fields: object) -> object:
    """A signal with random content of the right shapes, written out from signals.py's comments."""
    size = Dimensions()
    shapes = {
        Truth: dict(
            qpos=size.nq, qvel=size.nv, torque=size.nj, torque_limit=size.nj, com=3, com_velocity=3,
            angular_momentum=3, palm_position=(2, 3), sole_position=(2, 3), external_force=3, zmp=2,
            time=None, torso_up=None,
        ),
        RobotState: dict(
            q=size.nq, v=size.nv, sole_wrench_in_world=(2, 6), palm_force_in_world=(2, 3), time=None, mass_scale=None
        ),
        Setpoint: dict(
            com_position=3, com_velocity=3, com_acceleration=3, joint_position=size.nj, joint_velocity=size.nj,
            torso_rotation=(3, 3), torso_angular_velocity=3,
            foot_position=(2, 3), foot_yaw=2, foot_yaw_rate=2, foot_velocity=(2, 3),
            foot_acceleration=(2, 3), hand_position=(2, 3),
            hand_velocity=(2, 3), hand_acceleration=(2, 3), hand_force=(2, 3), hand_force_cap=2, hand_normal=(2, 3),
            hand_friction=2, arm_keep_out=(2, 3, 5), hand_urgency=2, time=None,
        ),
        TorqueCommand: dict(
            torque=size.nj, acceleration=size.nv, sole_wrench_in_world=(2, 6), palm_force_in_world=(2, 3),
            solve_time=None,
        ),
    }[cls]  # fmt: skip
    values: dict[str, object] = {
        name: float(rng.normal()) if shape is None else rng.normal(size=shape) for name, shape in shapes.items()
    }
    if cls is Setpoint:
        values.update(foot_stance=rng.random(2) < 0.5, hand_mode=rng.integers(0, 3, 2))
    if cls is TorqueCommand:
        values.update(status=SolveStatus(int(rng.integers(0, 4))), fallback=bool(rng.random() < 0.5))
    if cls is Truth:
        contacts = np.zeros(int(rng.integers(0, MAX_CONTACTS + 1)), CONTACT)
        for name in CONTACT.names or ():
            contacts[name] = rng.integers(0, 50, contacts[name].shape)
        values.update(contacts=contacts)
    return cls(**(values | given_fields))


def random_tick(rng: np.random.Generator, **truth: object) -> tuple:
    return (random_signal(Truth, rng, **truth), *(random_signal(c, rng) for c in (RobotState, Setpoint, TorqueCommand)))


@settings(max_examples=20, deadline=None)
@given(expected=st.integers(0, 12), stride=st.integers(1, 7), ticks=st.integers(1, 30), seed=st.integers(0, 2**32 - 1))
def test_round_trip_with_growth(expected: int, stride: int, ticks: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    recorder = Recorder(Dimensions(), expected_ticks=expected, stride=stride)
    history = [random_tick(rng) for _ in range(ticks)]
    for tick in history:
        recorder.append(*tick)

    assert recorder.ticks == ticks
    samples = list(range(0, ticks, stride))
    np.testing.assert_array_equal(recorder.sample_ticks, samples)
    for parts, kept in ((EVERY_TICK, range(ticks)), (SAMPLED, samples)):
        for cls, prefix, names in parts:
            position = (Truth, RobotState, Setpoint, TorqueCommand).index(cls)
            for name in names:
                expected_rows = [getattr(history[k][position], name) for k in kept]
                np.testing.assert_array_equal(getattr(recorder, prefix + name), np.array(expected_rows))
    np.testing.assert_array_equal(recorder.states, np.column_stack([recorder.qpos, recorder.qvel]))
    for k, (truth, *_) in enumerate(history):
        contacts = recorder.contacts_at(k)
        for name in ("geoms", "position", "force", "distance"):
            given_rows = truth.contacts[name]
            np.testing.assert_array_equal(getattr(contacts, name), given_rows)
            np.testing.assert_array_equal(getattr(recorder.contacts, name)[recorder.contact_tick == k], given_rows)


def test_every_field_of_the_signals_is_recorded() -> None:
    """A field added to a signal must be recorded or excluded here on purpose."""
    elsewhere = {Truth: {"contacts"}}
    for cls in (Truth, RobotState, Setpoint, TorqueCommand):
        kept = [
            name for of, _, layout in EVERY_TICK + SAMPLED if of is cls for name in layout if name != "contact_count"
        ]
        declared = {field.name for field in fields(cls)}
        same_as_truth = set() if cls is Truth else {"time"}
        assert sorted(kept) == sorted(declared - elsewhere.get(cls, set()) - same_as_truth)


def test_contacts_of_any_ticks_in_any_order() -> None:
    rng = np.random.default_rng(3)
    recorder = Recorder(Dimensions(), expected_ticks=4)
    for _ in range(9):
        recorder.append(*random_tick(rng))
    ticks = [7, 0, 7, 3]
    for name in ("geoms", "position", "force", "distance"):
        apart = [getattr(recorder.contacts_at(k), name) for k in ticks]
        np.testing.assert_array_equal(getattr(recorder.contacts_of(ticks), name), np.concatenate(apart))
    assert len(recorder.contacts_of([]).force) == 0


def test_columns_do_not_alias_the_callers_arrays_and_are_read_only() -> None:
    rng = np.random.default_rng(0)
    recorder = Recorder(Dimensions(), expected_ticks=4)
    tick = random_tick(rng)
    recorder.append(*tick)
    before = recorder.qpos.copy()
    tick[0].qpos[:] = 7.0
    np.testing.assert_array_equal(recorder.qpos, before)
    with pytest.raises(ValueError, match="read-only"):
        recorder.qpos[0] = 0.0
    recorder.append(*tick)  # a view taken earlier must not lock the column


def test_hash_is_sha256_of_the_states_in_order_and_of_nothing_else() -> None:
    rng = np.random.default_rng(1)
    ticks = [random_tick(rng) for _ in range(5)]
    recorder, other = Recorder(Dimensions(), expected_ticks=1), Recorder(Dimensions(), expected_ticks=100)
    for truth, *rest in ticks:
        recorder.append(truth, *rest)
        other.append(truth, *random_tick(rng)[1:])  # another controller and wall time, same states
        other.event(0.0, "noise")
    expected = hashlib.sha256(b"".join(t[0].qpos.tobytes() + t[0].qvel.tobytes() for t in ticks)).hexdigest()
    assert recorder.state_sha256 == other.state_sha256 == expected

    changed = Recorder(Dimensions(), expected_ticks=1)
    ticks[3][0].qvel[-1] = np.nextafter(ticks[3][0].qvel[-1], np.inf)
    for tick in ticks:
        changed.append(*tick)
    assert changed.state_sha256 != expected


def test_a_wrong_shape_is_refused_rather_than_broadcast() -> None:
    rng = np.random.default_rng(2)
    recorder = Recorder(Dimensions(), expected_ticks=1)
    with pytest.raises(ValueError, match=r"palm_position: got shape \(3,\), expected \(2, 3\)"):
        recorder.append(*random_tick(rng, palm_position=np.zeros(3)))


@pytest.mark.parametrize("qpos", [np.zeros(2 * Dimensions.nq)[::2], np.zeros(Dimensions.nq, np.float32)])
def test_an_array_whose_bytes_are_not_its_columns_is_refused(qpos: np.ndarray) -> None:
    recorder = Recorder(Dimensions(), expected_ticks=2)
    rng = np.random.default_rng(2)
    with pytest.raises(ValueError, match=r"qpos: got float\d\d.*, expected float64, contiguous"):
        recorder.append(*random_tick(rng, qpos=qpos))
    late = Recorder(Dimensions(), expected_ticks=2)
    late.append(*random_tick(rng))
    with pytest.raises((TypeError, ValueError)):  # not looked at any more, and still not taken
        late.append(*random_tick(rng, qpos=qpos))
    assert late.ticks == 1


def test_unknown_column_lists_the_choices() -> None:
    recorder = Recorder(Dimensions(), expected_ticks=1)
    with pytest.raises(AttributeError, match=r"qpso.*choose one of.*qpos"):
        _ = recorder.qpso
    with pytest.raises(KeyError, match="choose one of"):
        recorder.column("qpso")


def test_plan_events_join_the_runs_events() -> None:
    stage = StageReport(SolveStatus.SOLVED, 1e-3, 3)
    plan = Plan(
        time=0.5, mass=2.0, com=np.zeros((2, 3)), com_acceleration=np.zeros((2, 3)),
        com_height_band=np.zeros((2, 2)), zmp=np.zeros((2, 2)),
        support_polygon=np.zeros((4, 2)), delta_z=np.zeros((2, 2)), hand_reference=np.zeros((2, 2, 3)),
        contact_force=np.zeros((2, 2, 3)), contact_phase=np.zeros(2, np.int64), contact_patch=("", ""), progress=1.0,
        stage1=stage, stage2=stage, stage3=stage, firing=None, plan_time=1e-3, events=("a", "b"),
    )  # fmt: skip
    recorder = Recorder(Dimensions(), expected_ticks=1)
    recorder.event(0.1, "start")
    recorder.append_plan(plan)
    assert recorder.plans == [plan]
    assert [(e.time, e.text) for e in recorder.events] == [(0.1, "start"), (0.5, "a"), (0.5, "b")]
