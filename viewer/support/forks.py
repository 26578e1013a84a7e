"""Runs scripts in forks of one process, which imports once what all of them import.

Run: python forks.py ADDRESS                   until its standard input ends
     python forks.py ADDRESS SCRIPT ARGUMENT…  with the script's output and exit status

Torch and what draws take two seconds to be imported; most scripts are done in a third of one then.
"""

import gc
import importlib
import json
import os
import runpy
import select
import socket
import sys
import traceback
from contextlib import suppress

SHARED = (
    "ico3d.avatar.baking.shader_body",
    "ico3d.avatar.render_bundle",
    "support.avatars.moving_body",
    "support.bundles.skinned_person",
)
"""What scripts import, imported when the first one comes."""


def serve(address: str) -> None:
    """Forks for each script that is asked for."""
    gc.disable()  # what is imported stays
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(address)
        listener.listen(64)
        print("ready", flush=True)
        while listener in select.select([listener, sys.stdin], [], [])[0]:
            connection, _ = listener.accept()
            words, files, *_ = socket.recv_fds(connection, 1 << 16, 2)
            for module in SHARED:
                importlib.import_module(module)
            if os.fork() == 0:
                connection.send(bytes([_run(json.loads(words), files)]))
                os._exit(0)
            for file in files:
                os.close(file)
            connection.close()
            with suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG) != (0, 0):
                    pass  # some have ended


def _run(words: list[str], files: list[int]) -> int:
    """Does what `python SCRIPT ARGUMENT…` does, with these files for what it prints; its status."""
    for own, file in enumerate(files, 1):
        os.dup2(file, own)
    sys.argv = words
    sys.path[0] = os.path.dirname(words[0])
    try:
        runpy.run_path(words[0], run_name="__main__")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
    return 0


def ask(address: str, words: list[str]) -> int:
    """Has a script run there; its status."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
        connection.connect(address)
        socket.send_fds(connection, [json.dumps(words).encode()], [1, 2])
        answer = connection.recv(1)
    return answer[0] if answer else 1  # nothing is said by a process that was killed


if __name__ == "__main__":
    address, *words = sys.argv[1:]
    if words:
        sys.exit(ask(address, words))
    serve(address)
