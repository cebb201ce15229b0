"""The keys of `wbmpc interact`, and what each of them changes: no window, no robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType

import numpy as np

from wbmpc.signals import TargetMove, Vector

STEP = 0.01  # [m] by which one key press moves a target
SLOWEST = 1 / 16  # of real time


class Key(Enum):
    """Keys by GLFW's codes; MuJoCo's viewer has its own use for nearly all letters and figures."""

    SPACE = 32
    MINUS = 45
    EQUAL = 61
    ENTER = 257
    BACKSPACE = 259
    INSERT = 260
    RIGHT = 262
    LEFT = 263
    DOWN = 264
    UP = 265
    PAGE_UP = 266
    PAGE_DOWN = 267
    HOME = 268
    END = 269


class Wish(Enum):
    """What a key asks of the run, besides what the controls keep themselves."""

    PUSH = "push"
    RESET = "reset"
    QUIT = "quit"


DIRECTIONS = MappingProxyType(
    {
        Key.UP: (1, 0, 0),
        Key.DOWN: (-1, 0, 0),
        Key.LEFT: (0, 1, 0),
        Key.RIGHT: (0, -1, 0),
        Key.PAGE_UP: (0, 0, 1),
        Key.PAGE_DOWN: (0, 0, -1),
    }
)
_WISHES = {Key.ENTER: Wish.PUSH, Key.BACKSPACE: Wish.RESET, Key.END: Wish.QUIT}
_CODES = {key.value: key for key in Key}

HELP = """\
Double-click on a part of the robot selects it; Ctrl and the right mouse button then pull it (with Shift: in the
horizontal plane). The pull is a spring, MuJoCo's own; it reaches the plant as a disturbance of which the controller is
not told.

  Up, Down, Left, Right   move the target of the reach 1 cm ahead, back, to the left, to the right
  Page Up, Page Down      and up, down
  Home                    the next reach's target
  Enter                   push the torso, from anywhere
  Space                   pause, go on
  -, =                    half the pace, twice the pace (up to real time)
  Insert                  show or hide the plan: CoM (amber), ZMP (red), support polygon, patches
  Backspace               begin anew; the run so far is kept
  End                     end the run, as closing the window does

MuJoCo's own keys work too: C contact points, F contact forces, T transparent, F1 all of them."""


@dataclass
class Controls:
    """What the keys have set so far.

    Args:
        targets: where each reach's target is (3,) [m], by the reach's index among the scenario's tasks.
    """

    targets: Mapping[int, Vector]
    paused: bool = False
    pace: float = 1.0  # of real time
    plan_shown: bool = True
    chosen: int = 0  # which of the targets the arrows move
    _places: dict[int, Vector] = field(init=False)

    def __post_init__(self) -> None:
        self._places = {task: np.array(place, float) for task, place in self.targets.items()}

    @property
    def places(self) -> Vector:
        """(m, 3) [m] the targets as they are now, in the order of the tasks."""
        return np.array(list(self._places.values())).reshape(-1, 3)

    def press(self, code: int) -> Wish | TargetMove | None:
        """One key; what it asks of the run, if anything. Codes without a meaning here are MuJoCo's, and do nothing."""
        key = _CODES.get(code)
        if key is None:
            return None
        if key in _WISHES:
            return _WISHES[key]
        if key in DIRECTIONS:
            return self._moved(DIRECTIONS[key])
        if key is Key.HOME:
            self.chosen = (self.chosen + 1) % max(len(self._places), 1)
        elif key is Key.SPACE:
            self.paused = not self.paused
        elif key is Key.INSERT:
            self.plan_shown = not self.plan_shown
        else:
            self.pace = min(max(self.pace * (0.5 if key is Key.MINUS else 2.0), SLOWEST), 1.0)
        return None

    def _moved(self, direction: tuple[int, int, int]) -> TargetMove | None:
        if not self._places:
            return None
        task = list(self._places)[self.chosen]
        place = self._places[task] + STEP * np.array(direction)
        place[2] = max(place[2], 0.0)  # the floor
        self._places[task] = place
        return TargetMove(task, place)
