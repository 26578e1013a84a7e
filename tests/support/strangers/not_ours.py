"""A file that is replaced by what a stranger may leave in its place."""

import os
from collections.abc import Iterator
from pathlib import Path


def replacements(file: Path) -> Iterator[str]:
    """Puts a link to the same content in its place, and then others; yields what it is."""
    content = file.read_bytes()
    aside = file.with_name("aside")
    aside.write_bytes(content)
    file.unlink()
    file.symlink_to(aside)
    yield "a link"
    file.unlink()
    os.mkfifo(file)
    yield "a pipe"
    file.unlink()
    file.symlink_to("/dev/zero")
    yield "a link to what has no end"
    file.unlink()
    aside.rename(file)
