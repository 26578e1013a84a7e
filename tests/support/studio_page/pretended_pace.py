"""What measures the machine, as the environment says: at once, wrongly, or never."""

import os
import threading

from ico3d.recording.beside import end_with_parent

if __name__ == "__main__":
    end_with_parent()
    print("a warning of some library")
    print(os.environ["PACE"], flush=True)
    if os.environ["PACE"] == "wait":
        threading.Event().wait()
