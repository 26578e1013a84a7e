"""A maker of avatars that waits until it is ended: `python -m … FOLDER QUALITY …`."""

import sys
from pathlib import Path

from ico3d.common.files import write_atomic
from ico3d.recording.beside import end_with_parent

if __name__ == "__main__":
    end_with_parent()
    folder, quality, *_ = sys.argv[1:]
    write_atomic(Path(folder, "making", "began"), quality.encode())  # is there when it is whole
    if quality == "quick":  # it falls over
        sys.exit(3)
    import threading

    threading.Event().wait()
