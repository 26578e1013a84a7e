"""The process in which an avatar talks: `python -m ico3d.recording.making.talk FILE HOST TLS`.

It is `ico3d serve`, and ends with the process that started it.
"""

import sys
from pathlib import Path

from ico3d.chat.commands import Serve
from ico3d.errors import Ico3dError
from ico3d.recording.beside import end_with_parent

TLS = "tls"


def main() -> int:
    """Serves an avatar on a free port; the exit status."""
    end_with_parent()
    bundle, host, scheme = sys.argv[1:]
    try:
        Serve(Path(bundle), host, 0, tls=scheme == TLS).run()
    except Ico3dError as error:
        print(f"ico3d: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
