"""Which panels a run shows, and that they draw what the trace holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from traces import still

from wbmpc.errors import WbmpcError
from wbmpc.figures.figure import figure_of, save_figure
from wbmpc.figures.panels import panels_of
from wbmpc.figures.strip import across
from wbmpc.figures.trace import HandContact, Trace


def labels(trace: Trace) -> list[str]:
    return [axes.get_ylabel().split(",")[0] for axes in figure_of(trace, "made up").axes]


def sway(axis: int, size: float) -> np.ndarray:
    com = still().com.copy()
    com[:, axis] += size * np.sin(np.linspace(0, 6, 101))
    return com


def stepping() -> Trace:
    trace = still()
    trace.sole[50:, 0, :, 0] += 0.06
    trace.sole_force[40:50, 0] = 0.0
    return trace


def test_a_robot_that_stands_still_shows_its_balance_along_one_axis() -> None:
    assert labels(still()) == ["x [cm]"]


def test_panels_follow_from_what_happened() -> None:
    assert labels(still(com=sway(1, 0.03))) == ["y [cm]"]
    assert labels(still(com=sway(2, 0.03))) == ["z [cm]", "x [cm]"]
    far = sway(0, 0.2)
    assert labels(still(com=far + sway(2, 0.01) - still().com)) == ["x [cm]"]
    assert labels(still(com=far + sway(2, 0.04) - still().com)) == ["z [cm]", "x [cm]"]  # up stairs and on
    pushed = still()
    pushed.push[20:30] = [0.0, 14.0, 0.0]
    assert labels(pushed) == ["x [cm]", "velocity [m/s]"]
    asked = still()
    asked.delta_z[30:] = 0.04
    assert labels(asked) == ["x [cm]", "ΔZ [cm]"]
    held = still(hand_contacts=(HandContact(1, 0.3, 0.8, "rail"),))
    held.hand_force[30:80, 1] = 6.0
    assert labels(held) == ["x [cm]", "ΔZ [cm]", "hand force [N]"]
    assert labels(stepping()) == ["y [cm]", "x [cm]"]
    assert [panel.over_time for panel in panels_of(stepping())] == [False, True]


def test_the_curves_are_those_of_the_trace() -> None:
    trace = still(com=sway(0, 0.05))
    (axes,) = figure_of(trace, "made up").axes
    curves = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_allclose(curves["CoM"], np.column_stack([trace.time, 100 * trace.com[:, 0]]))
    np.testing.assert_allclose(curves["CoM planned"][:, 1], 0.0)


def test_every_stance_leaves_one_footprint_where_the_sole_was() -> None:
    axes = figure_of(stepping(), "made up").axes[0]
    prints = [patch.get_xy()[:4].mean(axis=0) for patch in axes.patches]
    np.testing.assert_allclose(sorted(map(tuple, prints)), [(0.0, -5.0), (0.0, 5.0), (6.0, 5.0)], atol=1e-9)


def test_a_push_and_a_patch_are_marked() -> None:
    trace = still(hand_contacts=(HandContact(0, 0.3, 0.8, "rail"),))
    trace.hand_force[30:80, 0] = 6.0
    trace.push[20:30] = [0.0, 14.0, 0.0]
    axes = figure_of(trace, "made up").axes[-1]
    assert [text.get_text() for text in axes.texts] == ["rail"]
    spans = sorted((patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches)
    np.testing.assert_allclose(spans, [(0.2, 0.29), (0.3, 0.8)], atol=1e-9)


@pytest.mark.parametrize("suffix", ["png", "webp", "pdf", "svg"])
def test_figures_are_written(suffix: str, tmp_path: Path) -> None:
    save_figure(figure_of(still(), "made up"), tmp_path / "new" / f"a.{suffix}")
    assert (tmp_path / "new" / f"a.{suffix}").stat().st_size > 1000


def test_bad_targets_are_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(WbmpcError, match=r"choose one of \.png"):
        save_figure(figure_of(still(), ""), tmp_path / "a.bmp")
    with pytest.raises(WbmpcError, match="cannot write "):
        save_figure(figure_of(still(), ""), tmp_path / "file" / "a.png")


@pytest.mark.parametrize(("axis", "best", "worst"), [(0, 90.0, 180.0), (1, 180.0, 90.0)])
def test_a_motion_is_seen_from_its_side(axis: int, best: float, worst: float) -> None:
    trace = still(com=sway(axis, 0.5))
    assert across(trace, best) > 0.98
    assert across(trace, worst) < 0.2
    assert across(still(), best) == pytest.approx(across(still(), worst)) == pytest.approx(np.sqrt(0.5))
