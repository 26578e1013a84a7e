"""A server of an avatar that waits until it is ended; of an empty file it does not start.

That of an avatar called Stubborn speaks on for a while, and one called Late never starts.
"""

import os
import signal
import sys
import threading
from pathlib import Path

from ico3d.recording.beside import end_with_parent

if __name__ == "__main__":
    end_with_parent()
    bundle, host, scheme = sys.argv[1:]
    name = Path(bundle).read_text()
    if not name:
        sys.exit(1)
    assert scheme == "plain"
    if name == "Stubborn":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    if name == "Late":
        threading.Event().wait()
    print(f"{name} is at http://{host}:{os.getpid()}/#key=a-b (Ctrl+C ends)", flush=True)
    threading.Event().wait()
