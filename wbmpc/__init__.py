"""Closed-loop MuJoCo testbed for three-stage whole-body MPC (SURENA-MINI)."""
