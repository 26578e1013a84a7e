"""Runs scripts and servers in forks of one process, which imports once what all of them import.

Run: python forks.py ADDRESS                   until its standard input ends
     python forks.py ADDRESS SCRIPT ARGUMENT…  with the script's output and exit status
     python forks.py ADDRESS serve ARGUMENT…   the same of `ico3d serve`, which gets the signals

Torch and what draws take two seconds to be imported, and what talks as long; most scripts are done
in a third of one then, and servers begin. On SIGUSR1 the fork is killed.
"""

import gc
import importlib
import json
import os
import runpy
import select
import signal
import socket
import sys
import threading
import traceback
from contextlib import suppress

SHARED = (
    "ico3d.avatar.baking.shader_body",
    "ico3d.avatar.render_bundle",
    "support.avatars.moving_body",
    "support.bundles.skinned_person",
)
"""What scripts import, imported when the first one comes."""
SERVING = ("ico3d.chat.parts", "ico3d.chat.serving.server", "ico3d.chat.serving.sessions")
"""What servers import, the same."""
SERVE = "serve"
PASSED_ON = {signal.SIGINT: signal.SIGINT, signal.SIGUSR1: signal.SIGKILL}
"""Signals that whoever asks gets, and those that the fork gets then."""


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
            asked = json.loads(words)
            for module in SERVING if asked[0] == SERVE else SHARED:
                importlib.import_module(module)
            if os.fork() == 0:
                threading.Thread(target=_heed, args=(connection,), daemon=True).start()
                status = _run(asked, files)
                connection.send(bytes([status]))
                if asked[0] == SERVE:
                    sys.exit(status)  # servers clean up
                os._exit(0)
            for file in files:
                os.close(file)
            connection.close()
            with suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG) != (0, 0):
                    pass  # some have ended


def _run(words: list[str], files: list[int]) -> int:
    """Does what was asked, with these files for what it prints; its status."""
    for own, file in enumerate(files, 1):
        os.dup2(file, own)
    try:
        if words[0] == SERVE:
            return _serve_avatar(words)
        sys.argv = words
        sys.path[0] = os.path.dirname(words[0])
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


def _serve_avatar(words: list[str]) -> int:
    """Does what `ico3d serve` does; its status."""
    from ico3d.cli import main

    gc.freeze()
    gc.enable()
    return main(words)


def _heed(connection: socket.socket) -> None:
    """Takes signals from whoever asked, and ends with them."""
    with suppress(OSError):
        while told := connection.recv(1):
            os.kill(os.getpid(), told[0])
    os.kill(os.getpid(), signal.SIGKILL)  # nobody is there any more


def ask(address: str, words: list[str]) -> int:
    """Has a script or a server run there; its status."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
        connection.connect(address)
        socket.send_fds(connection, [json.dumps(words).encode()], [1, 2])
        for number, passed_on in PASSED_ON.items():
            signal.signal(number, lambda *_, told=passed_on: connection.send(bytes([told])))
        answer = connection.recv(1)
    return answer[0] if answer else 1  # nothing is said by a process that was killed


if __name__ == "__main__":
    address, *words = sys.argv[1:]
    if words:
        sys.exit(ask(address, words))
    serve(address)
