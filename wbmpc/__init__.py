"""Closed-loop MuJoCo testbed for three-stage whole-body MPC (SURENA-MINI)."""

import os

# The matrices are small: more BLAS threads only add jitter. Read once, when numpy is first imported.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
