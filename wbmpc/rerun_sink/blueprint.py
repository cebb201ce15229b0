"""How the recording opens: the robot and the log on the left, curves by subject on the right."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

from wbmpc.rerun_sink.stream import TIMELINE

_EYE_OFFSET = np.array([-0.30, -1.05, 0.30])  # [m] from the robot: from its right, where a lean shows
_LOOK_AHEAD = np.array([0.08, 0.0, -0.03])  # [m] what the robot reaches for is before it
_BACKGROUND = (203, 214, 228)

# Tab -> title of the plot -> entity whose curves it shows.
_PLOTS = {
    "Overview": {
        "CoM height [m]": "/com/z",
        "ZMP x [m]": "/zmp/x",
        "ZMP y [m]": "/zmp/y",
        "Palm error [mm]": "/tracking/palm_error",
    },
    "Planner": {
        "CoM x [m]": "/com/x",
        "CoM y [m]": "/com/y",
        "ΔZ [mm]": "/planner/delta_z",
        "Progress": "/planner/progress",
    },
    "Tracker": {
        "CoM error [mm]": "/tracking/com_error",
        "Torque / limit": "/joints/torque_share",
        "Joint velocity [rad/s]": "/joints/velocity",
        "Joint position minus reference [rad]": "/joints/posture_error",
    },
    "Contacts": {
        "Left hand [N]": "/contacts/left_hand",
        "Right hand [N]": "/contacts/right_hand",
        "Left foot [N]": "/contacts/left_foot",
        "Right foot [N]": "/contacts/right_foot",
        "Penetration [mm]": "/contacts/penetration",
    },
    "Solvers": {
        "Planner [ms]": "/solvers/plan",
        "Tracker [ms]": "/solvers/tracker",
        "Iterations": "/solvers/iterations",
    },
    "Timing": {
        "Tick began late [ms]": "/timing/tick_start_late",
        "Tick [ms]": "/timing/tick_time",
        "Plan in use [ms]": "/timing/plan_latency",
        "Plan ready [ms]": "/timing/plan_ready",
    },
}
# Tab -> title and entity of the state lanes under its plots.
_PHASES = ("Contact phases", "/contact_phase")
_LANES = {"Overview": _PHASES, "Contacts": _PHASES, "Solvers": ("Solver status", "/solver_status")}


def layout(look_at: ArrayLike) -> Any:
    """The default blueprint; `look_at` (3,) [m] is the centre of the 3D view."""
    look_target = np.asarray(look_at, dtype=float) + _LOOK_AHEAD
    # time_ranges stay unset: a range of zero width hides whatever falls between two samples.
    eye = rrb.EyeControls3D(position=look_target + _EYE_OFFSET, look_target=look_target, eye_up=(0, 0, 1))
    scene = rrb.Spatial3DView(origin="/world", name="Robot", eye_controls=eye, line_grid=False, background=_BACKGROUND)
    log = rrb.TextLogView(origin="/log", name="Events")
    tabs = rrb.Tabs(
        *(_curves(name, plots, _LANES.get(name)) for name, plots in _PLOTS.items()),
        rrb.TextDocumentView(origin="/planner/candidates", name="Stage 3"),
        rrb.TextDocumentView(origin="/scenario", name="Scenario"),
        rrb.TextDocumentView(origin="/verdict", name="Verdict"),
        active_tab=0,
    )
    left = rrb.Vertical(scene, log, row_shares=[3, 1])
    panels = (
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
    )
    return rrb.Blueprint(rrb.Horizontal(left, tabs, column_shares=[1, 1]), *panels, auto_layout=False, auto_views=False)


def _curves(name: str, plots: dict[str, str], lanes: tuple[str, str] | None) -> Any:
    """One tab: a plot above the other, and lanes of states at the bottom."""
    views: list[Any] = [
        # With a legend for each of the joints there would be no room for their curves.
        rrb.TimeSeriesView(origin=origin, name=title, plot_legend=rrb.PlotLegend(visible="/joints/" not in origin))
        for title, origin in plots.items()
    ]
    if lanes:
        views.append(rrb.StateTimelineView(origin=lanes[1], name=lanes[0]))
    return rrb.Vertical(*views, name=name)
