"""What goes between the loop and the window, sixty times a second: a frame to draw, and what the person has done."""

from __future__ import annotations

from dataclasses import dataclass

from wbmpc.signals import Vector


@dataclass(frozen=True, slots=True)
class Frame:
    """Everything that the window draws. All positions are in world."""

    qpos: Vector  # (nq,) MuJoCo, of robot and free objects
    qvel: Vector  # (nv,)
    control: Vector  # (nj,) [N·m] so that the window's contact forces are the run's
    com: Vector  # (N, 3) [m] planned CoM
    zmp: Vector  # (N, 3) [m] planned ZMP, on the ground
    support: Vector  # (k, 3) [m] vertices of the support polygon
    targets: Vector  # (m, 3) [m] of the reaches
    chosen: int  # which of the targets the keys move; -1: there is none
    patches: tuple[str, ...]  # names of those that hands go to or press on
    plan_shown: bool
    caption: tuple[str, str]  # lines of names, lines of values


@dataclass(frozen=True, slots=True)
class MousePush:
    """A force by the mouse on a point of a body."""

    body: int  # MuJoCo's id
    force: Vector  # (3,) [N] in world
    point: Vector  # (3,) [m] in the body's frame


@dataclass(frozen=True, slots=True)
class Inputs:
    """What the person has done since the last frame."""

    keys: tuple[int, ...] = ()  # GLFW's codes, in order
    push: MousePush | None = None  # that goes on now
    closed: str = ""  # why there is no window any more; empty: there is
