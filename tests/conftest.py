"""Choose MuJoCo's off-screen OpenGL before any test imports mujoco, which reads the choice only once."""

import wbmpc.render  # noqa: F401
