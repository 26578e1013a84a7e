"""Helpers for writing multiview folders."""

import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ico3d.errors import CaptureError


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A temporary folder that becomes `out` after the `with` block, or is removed if it raises.

    Raises:
        CaptureError: If `out` exists.
    """
    if out.exists():
        raise CaptureError(f"{out} exists already: remove it or choose another folder.")
    out.parent.mkdir(parents=True, exist_ok=True)
    work = out.with_name(f".{out.name}.{secrets.token_hex(4)}")
    work.mkdir()  # not mkdtemp: who may read it is for the umask to say
    try:
        yield work
        work.rename(out)
    finally:
        shutil.rmtree(work, ignore_errors=True)


@contextmanager
def shown(what: str, total: int) -> Iterator[Callable[[], None]]:
    """A progress bar; yields a function to call after each step."""
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(what, total=total)
        yield lambda: progress.advance(task)
