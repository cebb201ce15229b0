"""The prediction matrices against step-by-step integration of a constant jerk, and against the paper's closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from wbmpc.planner.preview import Preview
from wbmpc.signals import Vector

N, T = 16, 0.1
PREVIEW = Preview(steps=N, step=T)
numbers = st.floats(-5, 5)


def predicted(preview: Preview, state: Vector, jerk: Vector) -> Vector:
    return np.column_stack(
        [
            preview.P_ps @ state + preview.P_pu @ jerk,
            preview.P_vs @ state + preview.P_vu @ jerk,
            preview.P_as @ state + preview.P_au @ jerk,
        ]
    )


@given(state=arrays(float, 3, elements=numbers), jerk=arrays(float, N, elements=numbers))
def test_prediction_is_the_recursion_of_the_paper(state: Vector, jerk: Vector) -> None:
    """[M] eq. state-eq applied N times."""
    A = np.array([[1, T, T**2 / 2], [0, 1, T], [0, 0, 1]])
    B = np.array([T**3 / 6, T**2 / 2, T])
    x, expected = state, []
    for u in jerk:
        x = A @ x + B * u
        expected.append(x)
    assert_allclose(predicted(PREVIEW, state, jerk), expected, atol=1e-10)


@given(state=arrays(float, 3, elements=numbers), jerk=arrays(float, 5, elements=numbers))
def test_prediction_is_the_integral_of_the_jerk(state: Vector, jerk: Vector) -> None:
    """Runge-Kutta of (ċ, c̈, u) in fine steps; exact for cubics, so that only rounding is left."""
    fine, h = 20, 0.07 / 20
    x, expected = state.copy(), []
    for u in jerk:
        for _ in range(fine):

            def rate(y: Vector, u: float = u) -> Vector:
                return np.array([y[1], y[2], u])

            k1 = rate(x)
            k2 = rate(x + h / 2 * k1)
            k3 = rate(x + h / 2 * k2)
            k4 = rate(x + h * k3)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        expected.append(x)
    assert_allclose(predicted(Preview(steps=5, step=0.07), state, jerk), expected, atol=1e-10)


def test_acceleration_matrices_are_as_printed() -> None:
    """[M] eq. P_as&P_au."""
    assert_allclose(PREVIEW.P_as, np.tile([0.0, 0.0, 1.0], (N, 1)), atol=0)
    assert_allclose(PREVIEW.P_au, T * np.tril(np.ones((N, N))), atol=0)


gain = arrays(float, N, elements=st.floats(0.1, 3.0))


@given(a=gain, b=gain)
def test_zmp_matrices_are_the_closed_form(a: Vector, b: Vector) -> None:
    """[M] eq. Pz-eqs entry by entry, with row i's own a and b in every column."""
    P_zs, P_zu = PREVIEW.zmp_matrices(a, b)
    for i in range(N):
        t = (i + 1) * T
        assert_allclose(P_zs[i], [a[i], a[i] * t, a[i] * t**2 / 2 - b[i]], atol=1e-12)
        for j in range(N):
            n = i - j
            entry = a[i] * (1 + 3 * n + 3 * n**2) * T**3 / 6 - b[i] * T if n >= 0 else 0.0
            assert P_zu[i, j] == pytest.approx(entry, abs=1e-12)


def test_last_diagonal_entry_is_not_the_printed_one() -> None:
    """Erratum: the paper prints a_{k+1}, b_{k+1} in the last row's diagonal; the recursion gives a_{k+N}, b_{k+N}."""
    a, b = np.linspace(1.0, 1.5, N), np.linspace(0.02, 0.03, N)
    jerk = np.zeros(N)
    jerk[-1] = 1.0  # only the last jerk: Z_N = a_N T³/6 − b_N T
    c, _, ddc = predicted(PREVIEW, np.zeros(3), jerk)[-1]
    z = a[-1] * c - b[-1] * ddc
    assert PREVIEW.zmp_matrices(a, b)[1][-1, -1] == pytest.approx(z, abs=1e-15)
    assert abs((a[0] * T**3 / 6 - b[0] * T) - z) > 1e-4


@pytest.mark.parametrize(("steps", "step"), [(0, 0.1), (3, 0.0), (3, -1.0)])
def test_empty_preview_is_refused(steps: int, step: float) -> None:
    with pytest.raises(ValueError, match=f"{steps} and {step}"):
        Preview(steps=steps, step=step)
