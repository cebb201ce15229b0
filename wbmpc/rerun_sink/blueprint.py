"""How the recording opens: the robot and the log on the left, curves by subject on the right."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

from wbmpc.rerun_sink.stream import TIMELINE

_EYE_OFFSET = np.array([-0.50, -0.72, 0.36])  # [m] to its right, where a lean shows, and behind: it sees what is ahead
_LOOK_AHEAD = np.array([0.08, 0.0, -0.03])  # [m] what the robot reaches for is before it
_BACKGROUND = (203, 214, 228)


class _Lanes(NamedTuple):
    """Lanes of states under a tab's plots."""

    title: str
    origin: str
    lanes: int


_PHASES = _Lanes("Stage 3 and contact phases", "/contact_phase", 3)
_STATUS = _Lanes("Solver status", "/solver_status", 4)

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
    "Solvers": {
        "Planner [ms]": "/solvers/plan",
        "Tracker, worst since the last sample [ms]": "/solvers/tracker",
        "Iterations": "/solvers/iterations",
    },
    "Contacts": {
        "Left hand [N]": "/contacts/left_hand",
        "Right hand [N]": "/contacts/right_hand",
        "Left foot [N]": "/contacts/left_foot",
        "Right foot [N]": "/contacts/right_foot",
        "Penetration [mm]": "/contacts/penetration",
    },
    "Mismatch": {
        "ZMP x [m]": "/zmp/x",
        "ZMP y [m]": "/zmp/y",
        "Left hand's force [N]": "/mismatch/left_hand",
        "Right hand's force [N]": "/mismatch/right_hand",
        "Vertical force of the feet [N]": "/mismatch/feet",
        "CoM height in stage 1's band [m]": "/com/z",
        "Rate of linear momentum [N]": "/mismatch/momentum_rate",
        "Rate of angular momentum [Nm]": "/mismatch/angular_momentum_rate",
    },
    "Timing": {
        "Tick began late [ms]": "/timing/tick_start_late",
        "Tick [ms]": "/timing/tick_time",
        "Plan in use [ms]": "/timing/plan_latency",
        "Plan ready [ms]": "/timing/plan_ready",
    },
}
# Whose colours the key does not explain.
_WITH_LEGEND = ("/tracking/", "/planner/delta_z", "/solvers/plan", "/solvers/iterations")
KEY = "/key"
_LANE_SHARE, _KEY_SHARE = 0.087, 0.06  # of all plots' height: one lane, the key
KEY_TEXT = (
    "**Blue** measured, **amber** planned or commanded, **grey** limits; **x** red, **y** green, **z** blue, "
    "pale if planned"
)
_LANES = {"Overview": _PHASES, "Planner": _PHASES, "Contacts": _PHASES, "Mismatch": _PHASES, "Solvers": _STATUS}
_TWO_COLUMNS = ("Mismatch",)
# Tab -> entity whose text it shows.
_TEXTS = {"Stage 3": "/planner/candidates", "Verdict": "/verdict", "Scenario": "/scenario"}


def layout(look_at: ArrayLike, *, beside: str = "") -> Any:
    """The default blueprint; `look_at` (3,) [m] is the centre of the 3D view.

    `beside`: a prefix under which the file holds a second run, shown in the same views.
    """
    look_target = np.asarray(look_at, dtype=float) + _LOOK_AHEAD
    # time_ranges stay unset: a range of zero width hides whatever falls between two samples.
    eye = rrb.EyeControls3D(position=look_target + _EYE_OFFSET, look_target=look_target, eye_up=(0, 0, 1))
    world = {"origin": "/world", "contents": _contents("/world", beside)}
    scene = rrb.Spatial3DView(**world, name="Robot", eye_controls=eye, line_grid=False, background=_BACKGROUND)
    columns = rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=[rrb.components.TextLogColumn("Body")])
    log = rrb.TextLogView(origin="/log", contents=_contents("/log", beside), name="Events", columns=columns)
    texts = _TEXTS | ({"Branch": f"{beside}/verdict"} if beside else {})
    tabs = rrb.Tabs(
        *(_curves(name, plots, beside) for name, plots in _PLOTS.items()),
        *(rrb.TextDocumentView(origin=origin, name=name) for name, origin in texts.items()),
        active_tab=0,
    )
    left = rrb.Vertical(scene, log, row_shares=[3, 1])
    panels = (
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
    )
    return rrb.Blueprint(rrb.Horizontal(left, tabs, column_shares=[1, 1]), *panels, auto_layout=False, auto_views=False)


def _contents(origin: str, beside: str) -> list[str]:
    """Of a view: what is under its origin, and the same of a second run."""
    return ["$origin/**", *([f"{beside}{origin}/**"] if beside else [])]


def _curves(name: str, plots: dict[str, str], beside: str) -> Any:
    """One tab: a plot above the other, or two beside each other, and lanes of states at the bottom."""
    views: list[Any] = [
        rrb.TimeSeriesView(
            origin=origin,
            contents=_contents(origin, beside),
            name=title,
            plot_legend=rrb.PlotLegend(visible=origin.startswith(_WITH_LEGEND)),
        )
        for title, origin in plots.items()
    ]
    if name in _TWO_COLUMNS:
        views = [rrb.Horizontal(*pair) for pair in zip(views[::2], views[1::2], strict=True)]
    plots_share = float(len(views))
    shares = [1.0] * len(views)
    if name in _LANES:
        below = _LANES[name]
        views.append(
            rrb.StateTimelineView(origin=below.origin, contents=_contents(below.origin, beside), name=below.title)
        )
        shares.append(_LANE_SHARE * below.lanes * plots_share * (2 if beside else 1))
    views.append(rrb.TextDocumentView(origin=KEY, name="Key", titlebar=False))
    return rrb.Vertical(*views, name=name, row_shares=[*shares, _KEY_SHARE * plots_share])
