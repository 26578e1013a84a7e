"""A maker of avatars that waits until it is ended: `python -m … FOLDER QUALITY …`."""

import sys
from pathlib import Path

from ico3d.recording.making.beside import end_with_parent

if __name__ == "__main__":
    end_with_parent()
    folder, quality, *_ = sys.argv[1:]
    Path(folder, "making", "began").write_text(quality)
    if quality == "quick":  # it falls over
        sys.exit(3)
    import threading

    threading.Event().wait()
