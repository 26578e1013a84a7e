"""The process that measures how fast this machine is: `python -m ico3d.recording.making.pace`.

It is one of its own, for what it needs is large, and holds the GPU, until its process ends.
"""

import sys

from ico3d.recording.beside import end_with_parent

SAID = "seconds of a step:"
"""What stands before the number that it prints."""


def main() -> int:
    """Prints the seconds of a step of the standard size; the exit status."""
    end_with_parent()
    from ico3d.creating.pace import set_pace

    print(SAID, f"{set_pace('auto'):.6f}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
