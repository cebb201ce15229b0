"""The life of a hand contact in every order; the palm follows its reference onto a surface that may be there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.hand_contact import LOST_TIME, PATIENCE, HandContact
from wbmpc.planner.settings import ContactSettings
from wbmpc.scenario import PatchPose
from wbmpc.signals import ContactPhase, HandMode, Vector

SETTINGS = ContactSettings()
DT, RADIUS = 0.01, 0.015
HOME = np.array([0.0, -0.15, 0.25])
PATCH = PatchPose("top", "table", np.array([0.24, -0.11, 0.20]), np.array([0.0, 0.0, 1.0]), 0.5, 20.0)
STIFFNESS = 2000.0  # [N/m]

NONE, NEEDED, CHOSEN, APPROACHING, SENSED, LOADED, QUIET, UNLOADED, RELEASED = ContactPhase


class Bench:
    """One hand contact, its palm (follows perfectly, stopped by the surface) and what it reports, plan by plan."""

    def __init__(self, *, surface: float | None = 0.20, stuck: bool = False) -> None:
        self.contact = HandContact(1, SETTINGS, palm_radius=RADIUS)
        self.surface = surface  # [m] real height of the table; None: absent
        self.stuck = stuck  # the palm does not move at all
        self.palm, self.palm_velocity = HOME.copy(), np.zeros(3)
        self.urgency = 0.0
        self.pressing = 0.0  # [N] what the tracker makes of a held contact
        self.needed, self.quiet = True, False
        self.wanted = 5.0
        self.phases: list[ContactPhase] = []
        self.commands: list[Vector] = []
        self.velocities: list[Vector] = []
        self.outcomes: list[str] = []

    def force(self) -> Vector:
        if self.surface is None or self.palm[2] - RADIUS > self.surface + 1e-9:
            return np.zeros(3)
        return np.array([0.0, 0.0, self.pressing])

    def step(self) -> None:
        contact = self.contact
        outcome = contact.advance(
            DT, palm=self.palm, palm_velocity=self.palm_velocity, force=self.force(), wanted_force=self.wanted,
            needed=self.needed, quiet=self.quiet, urgency=self.urgency, home=HOME,
        )  # fmt: skip
        if outcome:
            self.outcomes.append(outcome)
        if contact.busy:
            position, velocity, _ = contact.reference()
            self.commands.append(position.copy())
            self.velocities.append(velocity.copy())
            if not self.stuck:
                self.palm = position.copy()
            if self.surface is not None and self.palm[2] - RADIUS <= self.surface:
                self.pressing = 5.0 if contact.touching else STIFFNESS * (self.surface - self.palm[2] + RADIUS)
                self.palm[2] = self.surface + RADIUS
        if not self.phases or self.phases[-1] != contact.phase:
            self.phases.append(contact.phase)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> float:
        for k in range(round(seconds / DT)):
            if until():
                return k * DT
            self.step()
        return seconds

    def choose(self) -> None:
        self.contact.need(True)
        assert self.contact.phase == NEEDED
        self.contact.choose(PATCH, palm=self.palm, palm_velocity=self.palm_velocity)

    def run_to(self, phase: ContactPhase, seconds: float = 6.0) -> float:
        used = self.run(seconds, lambda: self.contact.phase == phase)
        assert self.contact.phase == phase, f"stopped in {self.contact.phase.name} after {self.phases}"
        return used


def loaded_bench() -> Bench:
    bench = Bench()
    bench.choose()
    bench.run_to(LOADED)
    return bench


def test_a_whole_life_in_order() -> None:
    bench = loaded_bench()
    bench.run(0.5)
    assert bench.contact.phase == LOADED  # as long as it is needed
    bench.quiet, bench.needed = True, False
    bench.run_to(NONE)
    # the bench looks after each advance: CHOSEN lasts from the choice to the first one
    assert bench.phases == [APPROACHING, SENSED, LOADED, QUIET, UNLOADED, RELEASED, NONE]
    assert_allclose(bench.palm, HOME, atol=2e-3)
    assert not bench.outcomes
    assert bench.contact.patch is None


def test_times_of_the_phases() -> None:
    bench = Bench()
    bench.choose()
    bench.run_to(SENSED)
    assert bench.run_to(LOADED) == pytest.approx(SETTINGS.ramp_time, abs=2 * DT)
    bench.quiet, bench.needed = True, False
    bench.run_to(QUIET)
    assert bench.run_to(UNLOADED) == pytest.approx(SETTINGS.quiet_time, abs=2 * DT)
    assert bench.run_to(RELEASED) == pytest.approx(SETTINGS.ramp_time, abs=2 * DT)


def test_what_others_read_in_each_phase() -> None:
    bench = Bench()
    seen: dict[ContactPhase, tuple[bool, bool, bool, HandMode]] = {}

    def look() -> None:
        c = bench.contact
        seen.setdefault(c.phase, (c.busy, c.touching, c.expected, c.mode))

    look()
    bench.contact.need(True)
    look()
    bench.contact.choose(PATCH, palm=bench.palm, palm_velocity=bench.palm_velocity)
    look()
    for k in range(1500):
        bench.quiet, bench.needed = k > 600, k <= 600
        bench.step()
        look()
    free, move, hold = HandMode.FREE, HandMode.MOVE, HandMode.CONTACT
    assert seen == {
        NONE: (False, False, False, free),
        NEEDED: (False, False, True, free),
        CHOSEN: (True, False, True, move),
        APPROACHING: (True, False, True, move),
        SENSED: (True, True, True, hold),
        LOADED: (True, True, False, hold),
        QUIET: (True, True, False, hold),
        UNLOADED: (True, True, False, hold),
        RELEASED: (True, False, False, move),
    }


def test_need_marks_only_a_free_hand() -> None:
    bench = Bench()
    bench.contact.need(True)
    bench.contact.need(False)
    assert bench.contact.phase == NONE
    bench.choose()
    bench.contact.need(False)
    assert bench.contact.phase == CHOSEN
    bench.step()
    bench.contact.need(True)
    assert bench.contact.phase == APPROACHING


@given(height=st.floats(0.175, 0.222))
def test_the_descent_finds_a_surface_that_is_not_where_it_was_said_to_be(height: float) -> None:
    bench = Bench(surface=height)
    bench.choose()
    bench.run_to(SENSED)
    assert bench.palm[2] == pytest.approx(height + RADIUS, abs=1e-9)
    position, velocity, _ = bench.contact.reference()
    assert_allclose(position, bench.palm)  # it stays where it touched
    assert not velocity.any()
    assert max(abs(v[2]) for v in bench.velocities[-3:-1]) <= SETTINGS.touch_speed + 1e-12  # bounds the impact


def test_a_force_acts_where_the_palm_touches() -> None:
    """The patch's centre says where until then; a palm that lands beside it, or rolls on, says it itself."""
    bench, beside = Bench(surface=0.19), np.array([-0.024, 0.003, 0.0])
    assert bench.contact.grip is None
    bench.choose()
    while not bench.contact.touching:
        assert bench.contact.grip is PATCH
        bench.palm = bench.palm + (beside if bench.pressing else 0.0)
        bench.step()
    touched = np.array([*(PATCH.position + beside)[:2], 0.19])
    grip = bench.contact.grip
    assert grip is not None
    assert_allclose(grip.position, touched, atol=1e-9)
    assert (grip.name, grip.friction, grip.force_cap) == (PATCH.name, PATCH.friction, PATCH.force_cap)
    assert_allclose(grip.normal, PATCH.normal)
    rolled = bench.palm + np.array([0.004, 0.0, 0.0])
    for palm, expected in ((rolled, touched + np.array([0.004, 0.0, 0.0])), (bench.palm, touched)):
        bench.palm, bench.stuck = palm, True
        bench.step()
        grip = bench.contact.grip
        assert grip is not None
        assert_allclose(grip.position, expected, atol=1e-9)
    assert_allclose(bench.contact.reference()[0], bench.palm)  # the palm is held where it touched first
    assert bench.contact.patch is PATCH


def test_a_palm_on_a_wall_touches_it_at_its_side() -> None:
    wall = PatchPose("side", "wall", np.array([0.1, 0.25, 0.2]), np.array([0.0, -1.0, 0.0]), 0.5, 20.0)
    contact = HandContact(0, SETTINGS, palm_radius=RADIUS)
    contact.choose(wall, palm=HOME, palm_velocity=np.zeros(3))
    contact.phase = LOADED
    contact.advance(
        DT, palm=np.array([0.11, 0.236, 0.19]), palm_velocity=np.zeros(3), force=np.array([0.0, -5.0, 0.0]),
        wanted_force=5.0, needed=True, quiet=False, urgency=0.0, home=HOME,
    )  # fmt: skip
    assert contact.grip is not None
    assert_allclose(contact.grip.position, [0.11, 0.251, 0.19], atol=1e-12)


def test_a_surface_that_is_not_there_fails_after_the_search() -> None:
    bench = Bench(surface=None)
    bench.choose()
    bench.run(6.0, lambda: bool(bench.outcomes))
    assert bench.outcomes == ["missing"]
    lowest = PATCH.position[2] + RADIUS - SETTINGS.search_depth
    assert min(c[2] for c in bench.commands) == pytest.approx(lowest, abs=1e-9)
    bench.contact.release(palm=bench.palm, home=HOME)  # as the planner does then
    bench.run_to(NONE)
    assert_allclose(bench.palm, HOME, atol=2e-3)


def test_a_palm_that_never_arrives_fails_after_its_patience() -> None:
    bench = Bench(stuck=True)
    bench.choose()
    used = bench.run(8.0, lambda: bool(bench.outcomes))
    assert bench.outcomes == ["unreached"]
    way = np.linalg.norm(PATCH.position + (RADIUS + SETTINGS.approach_clearance) * PATCH.normal - HOME)
    assert used == pytest.approx(max(0.4, way / SETTINGS.approach_speed) + PATIENCE, abs=5 * DT)


def test_an_approach_that_is_no_longer_needed_is_given_up() -> None:
    bench = Bench()
    bench.choose()
    bench.run(0.3)
    bench.needed = False
    assert bench.run_to(RELEASED) == pytest.approx(0.2, abs=3 * DT)  # a flicker of the need is not enough
    bench.run_to(NONE)
    assert SENSED not in bench.phases


def test_a_contact_that_loses_its_force_is_looked_for_again() -> None:
    bench = loaded_bench()
    bench.surface = 0.185  # the table sinks by 1.5 cm under the load
    assert bench.run_to(APPROACHING) == pytest.approx(LOST_TIME, abs=3 * DT)
    assert bench.contact.expected  # the task waits
    assert not bench.contact.caps(np.zeros(1)).any()
    bench.run_to(LOADED)
    assert bench.palm[2] == pytest.approx(0.185 + RADIUS, abs=1e-9)
    assert not bench.outcomes


def test_a_contact_that_carries_nothing_because_nothing_is_asked_is_not_lost() -> None:
    bench = loaded_bench()
    bench.pressing = 0.0
    bench.wanted = 0.0
    for _ in range(100):
        bench.contact.advance(
            DT,
            palm=bench.palm,
            palm_velocity=np.zeros(3),
            force=np.zeros(3),
            wanted_force=0.0,
            needed=True,
            quiet=False,
            urgency=0.0,
            home=HOME,
        )
    assert bench.contact.phase == LOADED


def test_a_lost_contact_with_nothing_below_fails() -> None:
    bench = loaded_bench()
    bench.surface = None
    bench.run(4.0, lambda: bool(bench.outcomes))
    assert bench.outcomes == ["missing"]


def test_a_need_that_returns_while_quiet_goes_on() -> None:
    bench = loaded_bench()
    bench.quiet = True
    bench.run_to(QUIET)
    bench.run(0.1)
    bench.quiet = False
    bench.run_to(LOADED, seconds=0.05)
    bench.quiet = True
    bench.run_to(QUIET, seconds=0.05)
    assert bench.run_to(UNLOADED) == pytest.approx(SETTINGS.quiet_time, abs=2 * DT)  # counted anew


def test_a_need_that_returns_while_unloading_loads_again_from_there() -> None:
    bench = loaded_bench()
    bench.quiet, bench.needed = True, False
    bench.run_to(UNLOADED)
    bench.run(0.15)
    before = bench.contact.caps(np.zeros(1))[0]
    assert 0.0 < before < PATCH.force_cap
    bench.quiet, bench.needed = False, True
    bench.step()
    assert bench.contact.phase == SENSED
    assert bench.contact.caps(np.zeros(1))[0] == pytest.approx(before, abs=PATCH.force_cap * 1.5 * DT / 0.3)
    bench.run_to(LOADED)
    assert RELEASED not in bench.phases


@settings(max_examples=40)
@given(
    switches=st.lists(st.tuples(st.booleans(), st.booleans(), st.sampled_from([0.2, 0.185, None])), max_size=12),
    hold=st.integers(1, 60),
)
def test_caps_are_bounded_and_never_jump_up(switches: list[tuple[bool, bool, float | None]], hold: int) -> None:
    """Whatever happens: 0 ≤ cap ≤ force cap, growing no faster than the ramp, and the preview begins with now."""
    bench = Bench()
    bench.choose()
    bench.run(1.6)
    slope = PATCH.force_cap / SETTINGS.ramp_time
    times = np.linspace(0.0, 1.6, 17)
    last = bench.contact.caps(np.zeros(1))[0]
    for needed, quiet, surface in switches:
        bench.needed, bench.quiet, bench.surface = needed, quiet, surface
        for _ in range(hold):
            bench.step()
            caps = bench.contact.caps(times)
            assert (caps >= 0.0).all()
            assert (caps <= PATCH.force_cap + 1e-12).all()
            assert (np.abs(np.diff(caps)) <= slope * 0.1 + 1e-9).all()
            assert caps[0] <= last + slope * DT + 1e-9
            assert bench.contact.touching or not caps.any()
            last = caps[0]


def test_preview_is_where_the_reference_will_be() -> None:
    """On the way the palm's previewed places are those that it is sent to later."""
    bench = Bench()
    bench.choose()
    bench.run(0.2)
    ahead = bench.contact.preview(np.array([0.1, 0.3, 0.5]))
    start = len(bench.commands)
    bench.run(0.5)
    later = np.array(bench.commands[start:])
    for place, seconds in zip(ahead, (0.1, 0.3, 0.5), strict=True):
        assert_allclose(later[round(seconds / DT) - 1], place, atol=1e-9)


def test_reference_velocity_is_the_derivative_of_its_position() -> None:
    bench = Bench()
    bench.choose()
    bench.run_to(SENSED)
    positions, velocities = np.array(bench.commands[1:-2]), np.array(bench.velocities[1:-2])
    middle = (positions[1:] - positions[:-1]) / DT
    mean = 0.5 * (velocities[1:] + velocities[:-1])
    kink = np.linalg.norm(velocities[1:] - velocities[:-1], axis=1) > 0.03  # where the descent begins
    assert kink.sum() <= 2
    assert_allclose(middle[~kink], mean[~kink], atol=4e-3)


class UrgentBench(Bench):
    """The same with the alarm on; the palm obeys accelerations, and the body carries it along at `drift` [m/s²]."""

    def __init__(self, *, velocity: Vector, drift: Vector) -> None:
        super().__init__()
        self.urgency, self.palm_velocity, self.drift = 1.0, velocity.copy(), drift

    def plan(self, acceleration: Vector, jerk: Vector) -> None:
        """Take in a plan."""
        self.acceleration = acceleration

    def followed(self, seconds: float) -> Vector:
        """Acceleration [m/s²] so long after the last plan."""
        return self.acceleration

    def land(self) -> tuple[float, float]:
        """Time [s] and speed into the surface [m/s] of the touch."""
        self.step()  # the contact hears of the alarm
        self.contact.choose(PATCH, palm=self.palm, palm_velocity=self.palm_velocity)
        fine = DT / 10
        for k in range(5000):
            if k % 10 == 0:
                self.contact.advance(
                    DT, palm=self.palm, palm_velocity=self.palm_velocity, force=np.zeros(3), wanted_force=0.0,
                    needed=True, quiet=False, urgency=1.0, home=HOME,
                )  # fmt: skip
                self.plan(self.contact.reference()[2], self.contact.jerk)
            self.palm_velocity = self.palm_velocity + fine * (self.followed(k % 10 * fine) + self.drift)
            self.palm = self.palm + fine * self.palm_velocity
            if (self.palm - PATCH.position) @ PATCH.normal < RADIUS:
                return (k + 1) * fine, -float(self.palm_velocity @ PATCH.normal)
        raise AssertionError("never touched")


class LateBench(UrgentBench):
    """The same with plans that are one period old when they are first followed, continued with their jerk."""

    def __init__(self, *, velocity: Vector, drift: Vector) -> None:
        super().__init__(velocity=velocity, drift=drift)
        self.plans = [(np.zeros(3), np.zeros(3))] * 2

    def plan(self, acceleration: Vector, jerk: Vector) -> None:
        self.plans = [self.plans[1], (acceleration, jerk)]

    def followed(self, seconds: float) -> Vector:
        acceleration, jerk = self.plans[0]
        return acceleration + (DT + seconds) * jerk


@given(
    velocity=st.tuples(*[st.floats(-0.3, 0.3)] * 3).map(np.array),
    drift=st.tuples(*[st.floats(-3, 3)] * 3).map(np.array),
)
def test_an_urgent_palm_is_there_in_time_and_softly_wherever_the_body_carries_it(
    velocity: Vector, drift: Vector
) -> None:
    way = float(np.linalg.norm(PATCH.position + RADIUS * PATCH.normal - HOME))
    time, speed = UrgentBench(velocity=velocity, drift=drift).land()
    assert time < 1.6 * np.sqrt(6.0 * way / SETTINGS.urgent_acceleration)
    assert 0.0 < speed < 3.0 * SETTINGS.urgent_touch_speed


@given(
    velocity=st.tuples(*[st.floats(-0.3, 0.3)] * 3).map(np.array),
    drift=st.tuples(*[st.floats(-3, 3)] * 3).map(np.array),
)
def test_an_urgent_palm_lands_softly_though_every_plan_comes_late(velocity: Vector, drift: Vector) -> None:
    """As in the loop a plan is followed from one period after its snapshot to the next one's turn."""
    assert LateBench(velocity=velocity, drift=drift).land()[1] < 3.0 * SETTINGS.urgent_touch_speed


def test_a_hurried_palm_that_is_there_early_is_not_called_back() -> None:
    bench = UrgentBench(velocity=np.zeros(3), drift=np.zeros(3))
    bench.step()
    bench.contact.choose(PATCH, palm=HOME, palm_velocity=np.zeros(3))
    above = PATCH.position + (RADIUS + 0.006) * PATCH.normal
    for velocity in (-0.3, -0.2, 0.0):
        bench.contact.advance(
            DT, palm=above, palm_velocity=velocity * PATCH.normal, force=np.zeros(3), wanted_force=0.0,
            needed=True, quiet=False, urgency=1.0, home=HOME,
        )  # fmt: skip
        place = bench.contact.preview(np.array([0.03]))[0]  # whatever its speed: on at its landing speed
        assert (place - above) @ PATCH.normal == pytest.approx(-0.03 * SETTINGS.urgent_touch_speed)
