"""The ZMP with an external force against Newton-Euler on point forces; the errata of the paper shown to be errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from newton_euler import centre_of_pressure
from numpy.testing import assert_allclose

from wbmpc.planner.com_height import HeightPlan
from wbmpc.planner.contact_force import Need, polygon_bound, polygon_rows, shift_bound, shift_rows
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import SupportPolygon
from wbmpc.planner.whole_body import HorizontalPlan
from wbmpc.planner.zmp_model import free_model, held, loaded_model, need_of
from wbmpc.signals import GRAVITY, Vector

MASS, PLANE = 3.4, 0.03  # [kg], [m] the feet stand a little above the world's origin
seeds = st.integers(0, 2**32 - 1)


class Case:
    """A random CoM motion and a random force on the robot, feet pushing (D > 0), one knot."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.com = np.array([*rng.uniform(-0.1, 0.2, 2), PLANE + rng.uniform(0.15, 0.3)])
        self.acceleration = rng.uniform(-2.0, 2.0, 3)
        self.point = np.array([*rng.uniform(-0.3, 0.4, 2), rng.uniform(0.0, 0.4)])
        self.force = rng.uniform([-8, -8, -6], [8, 8, 14])
        self.lever, self.height = self.point[2] - PLANE, self.com[2] - PLANE
        self.D = MASS * (GRAVITY + self.acceleration[2]) - self.force[2]

    def pressure(self, *, with_force: bool, force: Vector | None = None) -> Vector:
        return centre_of_pressure(
            mass=MASS,
            com=self.com,
            acceleration=self.acceleration,
            plane_height=PLANE,
            point=self.point if with_force else None,
            force=(self.force if force is None else force) if with_force else None,
        )

    def need(self, delta_z: Vector, *, formulation: str = "exact") -> Need:
        """The need of this knot, from the paper's formulas for either formulation."""
        c_z, acc = self.height, self.acceleration
        exact = formulation == "exact"
        divisor = GRAVITY + acc[2] if exact else GRAVITY
        phantom = np.zeros(2) if exact else MASS * c_z * acc[:2] * acc[2] / GRAVITY
        corners = self.pressure(with_force=False) + np.array([[0.1, 0.05], [-0.1, 0.05], [-0.1, -0.05], [0.1, -0.05]])
        return Need(
            delta_z=delta_z[None],
            zmp=(self.com[:2] - c_z * acc[:2] / divisor)[None],
            weight=np.array([MASS * (GRAVITY + acc[2])]),
            polygons=(SupportPolygon.of_corners(corners, margin=0.0, plane_height=PLANE),),
            phantom=phantom[None],
        )


@given(seed=seeds)
def test_zmp_with_known_force_is_the_centre_of_pressure(seed: int) -> None:
    """[M] eqs. ZMP-eq, ZMP_k, ak_bk_qk, with the mended j."""
    case = Case(seed)
    height = height_plan(case.com[2:], case.acceleration[2:])
    point, force = case.point[None, None], case.force[None, None]
    model = loaded_model(height, forces=force, points=point, plane=PLANE, mass=MASS)
    zmp = model.a * case.com[:2] - model.b * case.acceleration[:2] + model.offset[0]
    assert_allclose(zmp, case.pressure(with_force=True), atol=1e-9)


@given(seed=seeds)
def test_zmp_over_the_horizon_is_the_centre_of_pressure_of_the_predicted_motion(seed: int) -> None:
    """P_zs x + P_zu U + P_zj, [M] eq. ZMP_k+1, at every knot of a random motion of all three axes."""
    rng = np.random.default_rng(seed)
    preview, steps = Preview(steps=6, step=0.1), 6
    states = np.column_stack([[0.0, 0.0, PLANE + 0.25], rng.uniform(-0.1, 0.1, 3), rng.uniform(-0.3, 0.3, 3)])
    jerk = rng.uniform(-1.0, 1.0, (3, steps))
    position = states @ preview.P_ps.T + jerk @ preview.P_pu.T  # (3, N)
    acceleration = states @ preview.P_as.T + jerk @ preview.P_au.T
    point = np.column_stack([rng.uniform(-0.3, 0.4, (steps, 2)), rng.uniform(0.0, 0.4, steps)])
    force = rng.uniform([-8, -8, -6], [8, 8, 14], (steps, 3))
    height = height_plan(position[2], acceleration[2])
    model = loaded_model(height, forces=force[None], points=point[None], plane=PLANE, mass=MASS)
    P_zs, P_zu = preview.zmp_matrices(model.a, model.b)
    zmp = P_zs @ states[:2].T + P_zu @ jerk[:2].T + model.offset
    for k in range(steps):
        pressure = centre_of_pressure(
            mass=MASS, com=position[:, k], acceleration=acceleration[:, k], plane_height=PLANE,
            point=point[k], force=force[k],
        )  # fmt: skip
        assert_allclose(zmp[k], pressure, atol=1e-8)


@given(seed=seeds)
def test_known_forces_of_both_hands_are_summed(seed: int) -> None:
    """[M] eq. ak_bk_qk for two contacts at once, one of them perhaps without a patch."""
    rng, n = np.random.default_rng(seed), 3
    case = Case(seed)
    height = height_plan(np.full(n, case.com[2]), np.full(n, case.acceleration[2]))
    points = rng.uniform([-0.3, -0.3, 0.0], [0.4, 0.3, 0.4], (2, 3))
    forces = rng.uniform([-5, -5, -3], [5, 5, 8], (2, n, 3))
    used: list[Vector | None] = [points[0], points[1]]
    if rng.random() < 0.3:
        used[1], forces[1] = None, 0.0
    model = loaded_model(height, forces=forces, points=held(used, n), plane=PLANE, mass=MASS)
    for k in range(n):
        zmp = model.a[k] * case.com[:2] - model.b[k] * case.acceleration[:2] + model.offset[k]
        pressure = centre_of_pressure(
            mass=MASS, com=case.com, acceleration=case.acceleration, plane_height=PLANE, point=points,
            force=forces[:, k],
        )  # fmt: skip
        assert_allclose(zmp, pressure, atol=1e-8)


@given(seed=seeds)
def test_free_models(seed: int) -> None:
    """Without force: the exact ZMP is the centre of pressure; the paper's is the LIPM's, [M] eq. simplify-ZMPeq."""
    case = Case(seed)
    height = height_plan(np.full(2, case.com[2]), np.full(2, case.acceleration[2]))
    exact, paper = (free_model(height, plane=PLANE, mass=MASS, exact=e) for e in (True, False))
    pressure = case.pressure(with_force=False)
    assert_allclose(exact.a[0] * case.com[:2] - exact.b[0] * case.acceleration[:2], pressure, atol=1e-9)
    lipm = case.com[:2] - case.height * case.acceleration[:2] / GRAVITY
    assert_allclose(paper.a[0] * case.com[:2] - paper.b[0] * case.acceleration[:2], lipm, atol=1e-12)
    assert not exact.offset.any()
    assert not paper.offset.any()


@given(seed=seeds, exact=st.booleans())
def test_need_of_a_wish(seed: int, exact: bool) -> None:
    """The need of either formulation is the one whose shift rows and polygon rows the tests above check."""
    case = Case(seed)
    height = height_plan(case.com[2:], case.acceleration[2:])
    shift = np.array([[0.01, -0.02]])
    zero = np.zeros((1, 2))
    wish = HorizontalPlan(
        jerk=zero, com=case.com[None, :2], velocity=zero, acceleration=case.acceleration[None, :2], delta_z=shift,
        zmp=zero, footstep_shift=zero, joint_velocity=np.zeros(0),
    )  # fmt: skip
    expected = case.need(shift[0], formulation="exact" if exact else "paper")
    model = free_model(height, plane=PLANE, mass=MASS, exact=exact)
    need = need_of(wish, height, model, carried=np.zeros((2, 1, 3)), polygons=expected.polygons, mass=MASS, exact=exact)
    for name in ("delta_z", "zmp", "weight", "phantom"):
        assert_allclose(getattr(need, name), getattr(expected, name), atol=1e-9)


@given(seed=seeds)
def test_need_of_a_wish_with_something_in_the_hands(seed: int) -> None:
    """Case a and case b at once: the contact's force shifts the pressure that the carried thing has moved already."""
    rng = np.random.default_rng(seed)
    case = Case(seed)
    height = height_plan(case.com[2:], case.acceleration[2:])
    held_at, weight = rng.uniform([0.05, -0.1, 0.05], [0.2, 0.1, 0.3]), np.array([0.0, 0.0, -rng.uniform(1.0, 8.0)])
    model = loaded_model(height, forces=weight[None, None], points=held_at[None, None], plane=PLANE, mass=MASS)
    zero = np.zeros((1, 2))
    wish = HorizontalPlan(
        jerk=zero, com=case.com[None, :2], velocity=zero, acceleration=case.acceleration[None, :2], delta_z=zero,
        zmp=zero, footstep_shift=zero, joint_velocity=np.zeros(0),
    )  # fmt: skip
    polygons = case.need(np.zeros(2), formulation="exact").polygons
    need = need_of(wish, height, model, carried=weight[None, None], polygons=polygons, mass=MASS, exact=True)
    alone = centre_of_pressure(
        mass=MASS, com=case.com, acceleration=case.acceleration, plane_height=PLANE, point=held_at, force=weight
    )
    both = centre_of_pressure(
        mass=MASS, com=case.com, acceleration=case.acceleration, plane_height=PLANE,
        point=np.array([held_at, case.point]), force=np.array([weight, case.force]),
    )  # fmt: skip
    assert_allclose(need.zmp[0], alone, atol=1e-9)
    lever = case.point[2] - PLANE
    numerator = need.weight[0] * need.zmp[0] + lever * case.force[:2] - case.point[:2] * case.force[2]
    assert_allclose(numerator / (need.weight[0] - case.force[2]), both, atol=1e-9)


def height_plan(height: Vector, acceleration: Vector) -> HeightPlan:
    zero = np.zeros(len(height))
    return HeightPlan(jerk=zero, height=height, velocity=zero, acceleration=acceleration)


def printed_offset(case: Case) -> Vector:
    """j_k of [M] eq. ak_bk_qk as printed: metres minus newtons, over newtons."""
    return (case.point[:2] - case.force[2]) / case.D


def test_printed_offset_is_an_error() -> None:
    """Erratum: with the printed j the ZMP misses the centre of pressure by decimetres, and depends on the unit."""
    errors = []
    for seed in range(20):
        case = Case(seed)
        a, b = MASS * (GRAVITY + case.acceleration[2]) / case.D, MASS * case.height / case.D
        zmp = a * case.com[:2] - b * case.acceleration[:2] + printed_offset(case)
        errors.append(np.abs(zmp - case.pressure(with_force=True)).max())
    assert np.median(errors) > 0.05
    case, other = Case(3), Case(3)
    other.point = 1000 * case.point  # the same contact in millimetres: a length over there is 1000 times as large
    in_metres = (case.point[2] * case.force[:2] - case.point[:2] * case.force[2]) / case.D
    in_millimetres = (other.point[2] * case.force[:2] - other.point[:2] * case.force[2]) / case.D
    assert_allclose(in_millimetres, 1000 * in_metres)
    assert not np.allclose(printed_offset(other), 1000 * printed_offset(case))


@given(seed=seeds)
def test_paper_shift_is_correct_and_has_a_phantom(seed: int) -> None:
    """[M] eqs. DeltaZ, DeltaZ_k: Z_LIPM + ΔZ is the centre of pressure; without contact ΔZ is not zero."""
    case = Case(seed)
    c_z, acc, f, p = case.height, case.acceleration, case.force, case.point
    lipm = case.com[:2] - c_z * acc[:2] / GRAVITY  # [M] eq. simplify-ZMPeq

    def paper_shift(force: Vector) -> Vector:
        D = MASS * (acc[2] + GRAVITY) - force[2]
        return (
            case.lever / D * force[:2]
            + (-p[:2] - c_z * acc[:2] / GRAVITY + case.com[:2]) / D * force[2]
            + MASS * c_z * acc[:2] * acc[2] / (GRAVITY * D)
        )

    assert_allclose(lipm + paper_shift(f), case.pressure(with_force=True), atol=1e-9)
    phantom = c_z * acc[:2] * acc[2] / (GRAVITY * (GRAVITY + acc[2]))
    assert_allclose(paper_shift(np.zeros(3)), phantom, atol=1e-12)
    exact_free = case.com[:2] - c_z * acc[:2] / (GRAVITY + acc[2])
    assert_allclose(exact_free, case.pressure(with_force=False), atol=1e-9)  # the exact ΔZ without contact is zero


def test_phantom_is_millimetres_in_ordinary_motion() -> None:
    """4.5 mm at c̈ = 1 and c̈_z = 2 m/s² for a CoM at 0.264 m: more than the 2 mm that would fire stage 3."""
    phantom = 0.264 * 1.0 * 2.0 / (GRAVITY * (GRAVITY + 2.0))
    assert phantom == pytest.approx(4.56e-3, rel=1e-2)
    assert phantom > ContactSettings().need_threshold


@given(seed=seeds, formulation=st.sampled_from(["exact", "paper"]))
def test_force_of_the_shift_rows_gives_the_shift(seed: int, formulation: str) -> None:
    """[M] eq. neweq: any f with G f = h moves the feet's pressure to the wanted place, under Newton-Euler."""
    rng = np.random.default_rng(seed)
    case = Case(seed)
    case.point[2] = PLANE + 0.1  # f_xy solves for any f_z; low contacts are the next test
    need = case.need(rng.uniform(-0.03, 0.03, 2), formulation=formulation)
    G, h = shift_rows(need, case.point)[0], shift_bound(need)[0]
    vertical = rng.uniform(0.0, 12.0)
    force = np.array([*np.linalg.solve(G[:, :2], h - G[:, 2] * vertical), vertical])
    wanted = need.zmp[0] + need.delta_z[0]
    assert_allclose(case.pressure(with_force=True, force=force), wanted, atol=1e-9)


def test_shift_rows_stay_finite_at_the_foot_plane() -> None:
    """Erratum: the paper divides by p_z; a contact in the foot plane shifts the pressure with f_z alone."""
    case = Case(0)
    case.point[2] = PLANE
    shift = np.array([-0.02, 0.0])
    need = case.need(shift)
    case.point[:2] = need.zmp[0] + np.array([0.2, 0.0])  # in line with the wanted shift
    G, h = shift_rows(need, case.point)[0], shift_bound(need)[0]
    force = np.linalg.lstsq(G, h, rcond=None)[0]
    assert_allclose(G @ force, h, atol=1e-12)
    moved = case.pressure(with_force=True, force=force) - case.pressure(with_force=False)
    assert_allclose(moved, shift, atol=1e-9)
    assert force[2] == pytest.approx(need.weight[0] * 0.02 / 0.22)  # the lever rule, from moments about the new ZMP


def polygon_agrees(case: Case, need: Need) -> None:
    P, q = polygon_rows(need, case.point)[0], polygon_bound(need)[0]
    excess = need.polygons[0].excess(case.pressure(with_force=True))
    rows = P @ case.force - q
    real = np.isfinite(need.polygons[0].offsets)
    assert rows[real].max() / case.D == pytest.approx(excess, abs=1e-9)


@given(seed=seeds)
def test_polygon_rows_are_the_pressure_in_the_polygon(seed: int) -> None:
    """The largest row over the feet's vertical force is how far the pressure lies outside, in metres."""
    case = Case(seed)
    polygon_agrees(case, case.need(np.zeros(2)))


def test_polygon_rows_of_the_paper_formulation() -> None:
    for seed in range(10):
        case = Case(seed)
        polygon_agrees(case, case.need(np.zeros(2), formulation="paper"))
