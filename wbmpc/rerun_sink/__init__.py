"""Recordings for the rerun viewer: the recorder's columns to one .rrd file, and back."""

from wbmpc.rerun_sink.scene import Patch
from wbmpc.rerun_sink.sink import RerunSink

__all__ = ["Patch", "RerunSink"]
