"""What `wbmpc doctor` looks at: the machine, and a robot's MJCF."""
