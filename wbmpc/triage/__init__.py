"""Why a run failed: the first thing that went wrong, found in what was recorded."""

from wbmpc.triage.causes import Cause, Finding, Triage
from wbmpc.triage.first import Evidence, triage

__all__ = ["Cause", "Evidence", "Finding", "Triage", "triage"]
