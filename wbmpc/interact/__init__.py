"""A person at the controls of a real-time run: MuJoCo's viewer, pushes by mouse, targets by keys."""
