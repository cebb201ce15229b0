"""Of a robot's MJCF: whatever it holds, every check answers."""
