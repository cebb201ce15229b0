"""A process that has imported everything once and makes a copy of itself for each `wbmpc` of the documents.

Nine tenths of a short command are imports and the loading of compiled code. `python warm.py ADDRESS` listens at a
socket of the file system until it is ended; a command is asked for with its arguments, working folder, environment and
three standard files, and answered with its exit code.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import traceback
from pathlib import Path

LARGEST = 1_000_000  # [bytes] of a request


def ask(address: str, arguments: list[str]) -> int:
    """Have the server run a command as this process would."""
    request = json.dumps({"arguments": arguments, "folder": str(Path.cwd()), "environment": dict(os.environ)})
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(address)
        socket.send_fds(connection, [request.encode()], [0, 1, 2])
        connection.shutdown(socket.SHUT_WR)
        answer = connection.recv(16)
    return int(answer) if answer else 3


def serve(address: str) -> None:
    """Answer one request after the other; every one in a copy of this process, which is left as it was."""
    from wbmpc.warm_up import compile_kernels

    compile_kernels()
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(address)
        server.listen()
        while True:
            connection, _ = server.accept()
            with connection:
                child = os.fork()
                if child == 0:
                    answer(connection)
                os.waitpid(child, 0)


def answer(connection: socket.socket) -> None:
    """Run the command in this process and end it. The client waits for the code, not for the process."""
    data, files, _, _ = socket.recv_fds(connection, LARGEST, 3)
    while part := connection.recv(LARGEST):
        data += part
    request = json.loads(data)
    worker = os.fork()
    if worker:
        _, status = os.waitpid(worker, 0)
        connection.sendall(str(os.waitstatus_to_exitcode(status)).encode())
        os._exit(0)
    code = 3
    try:
        for place, file in enumerate(files):
            os.dup2(file, place)
        os.chdir(request["folder"])
        os.environ.update(request["environment"])
        from program import run_wbmpc

        code = run_wbmpc(request["arguments"])
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    serve(sys.argv[1])
