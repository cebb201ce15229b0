"""What a hurried palm does in the milliseconds between its touch and the first plan that knows of it."""

from __future__ import annotations

from dataclasses import replace

from wbmpc.signals import HandMode, Setpoint, Vector

TOUCHED = 2.0  # [N] normal force that is a touch: well above a sensor's noise, well below an impact
HURRIED = 0.5  # urgency from which a palm is on its way to a surface that it meets in motion


class TouchReflex:
    """Holds a hurried palm where it touches, at once.

    A plan is 10 to 20 ms old when it is followed. Until then the palm would go on braking against a surface that has
    stopped it already, bounce off, and be pushed at it again.
    """

    def __init__(self) -> None:
        self._touched = [False, False]

    def apply(self, setpoint: Setpoint, palm_force: Vector) -> Setpoint:
        """`setpoint`, with the mode CONTACT for a hurried palm that has touched since it set out.

        Args:
            palm_force: (2, 3) sensed, in world [N].
        """
        if max(setpoint.hand_urgency.tolist()) <= HURRIED:  # nearly every tick
            self._touched = [False, False]
            return setpoint
        for side in range(2):
            hurried = int(setpoint.hand_mode[side]) == HandMode.MOVE and setpoint.hand_urgency[side] > HURRIED
            normal_force = float(palm_force[side] @ setpoint.hand_normal[side])
            self._touched[side] = hurried and (self._touched[side] or normal_force > TOUCHED)
        if not any(self._touched):
            return setpoint
        modes = setpoint.hand_mode.copy()
        modes[self._touched] = HandMode.CONTACT
        return replace(setpoint, hand_mode=modes)
