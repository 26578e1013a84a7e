"""Somebody who has recorded three parts on the studio page, in which nothing but grey is seen.

Run: python recorded.py FOLDER NAME VIDEO.mp4

VIDEO.mp4, four seconds of the same grey, is written, too.
"""

import sys
from pathlib import Path

from support.studio_page.parts import begun, kept, part_file


def main() -> int:
    """Does what the file's docstring says; the exit status."""
    folder, name, video = sys.argv[1:]
    data = part_file(Path(video), 100).read_bytes()
    person = begun(Path(folder), name)
    for part in ("consent", "text-1", "left"):
        kept(person, part, data, seconds=4.0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
