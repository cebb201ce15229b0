"""A run in a rerun viewer while it goes on: where the viewer is, and who feeds it."""

from __future__ import annotations

import os
import re
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

import rerun as rr

from wbmpc.errors import WbmpcError
from wbmpc.rerun_sink.sink import RerunSink

PORT = 9876  # rerun's own default
PERIOD = 0.15  # [s] of the wall clock between two blocks
PATIENCE = 2.0  # [s] for a viewer elsewhere to answer
_ADDRESS = re.compile(r"(?:rerun\+http://)?(?P<host>\[[^]]+\]|[^:/\[\]]+)(?::(?P<port>\d{1,5}))?(?:/proxy/?)?")


def viewer_at(address: str) -> str:
    """The URL of a viewer that listens at `address`: HOST, HOST:PORT or rerun+http://HOST:PORT/proxy.

    Raises:
        WbmpcError: that is no address, or nobody listens there.
    """
    match = _ADDRESS.fullmatch(address)
    port = int(match["port"] or PORT) if match else 0
    if match is None or not 0 < port < 65536:
        raise WbmpcError(f"--view-at {address}: not an address; allowed: HOST, HOST:PORT, rerun+http://HOST:PORT/proxy")
    host = match["host"]
    try:
        socket.create_connection((host.strip("[]"), port), timeout=PATIENCE).close()
    except OSError as error:
        reason = error.strerror or str(error)
        raise WbmpcError(f"--view-at {address}: no viewer listens at {host}:{port} ({reason})") from None
    return f"rerun+http://{host}:{port}/proxy"


def new_viewer() -> str:
    """Open a viewer in a process of its own, or find the one that is open on rerun's port; its URL.

    Raises:
        WbmpcError: there is no screen for it, or it did not start.
    """
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise WbmpcError("--view: no display here (DISPLAY and WAYLAND_DISPLAY are not set); use --view-at HOST:PORT")
    try:
        rr.spawn(port=PORT, connect=False)
    except Exception as error:  # of rerun's own kinds, which differ by what went wrong
        first_line = (str(error).splitlines() or [type(error).__name__])[0]
        raise WbmpcError(f"--view: the viewer did not start: {first_line}") from None
    return viewer_at(f"127.0.0.1:{PORT}")


@contextmanager
def shown(sink: RerunSink) -> Iterator[None]:
    """Flush a viewer's sink from a thread of its own inside.

    The loop is not held up by a slow viewer; it shares its interpreter with this thread.
    """
    over = Event()

    def feed() -> None:
        while not over.wait(PERIOD):
            sink.flush()

    thread = Thread(target=feed, name="viewer", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
