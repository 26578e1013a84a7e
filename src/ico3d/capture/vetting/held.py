"""How much memory the pictures take that a decoder holds: what the next ones are made of, and more.

A stream of 123 kB can have FFmpeg hold more than 4 GB, and may begin to long after its begin.
"""

import os
from typing import Any

from ico3d.errors import CaptureError

MOST_BYTES = 2 << 30
"""Of all pictures of a decoder: enough for 8192 × 4320 pixels with 10 bits, 4:2:0, as phones film.

Codecs without references between pictures (ProRes, JPEG) may have twice as much of each value.
"""
HELD, HELD_ALONE = 19, 3
"""Pictures that a decoder holds at most besides one in each thread: 16 references of H.264 and
H.265, with those on their way (measured); without references those on their way alone."""
MOST_THREADS = 16
"""Threads of a decoder: FFmpeg takes no more by itself."""


def held_bytes(context: Any) -> int:
    """Bytes that the pictures of a decoder can take, as its stream is by now; 0 while that is open.

    Args:
        context: PyAV's context of a stream of pictures, with its number of threads.
    """
    held = HELD_ALONE if context.codec.intra_only else HELD
    return (held + context.thread_count) * _picture_bytes(context)


def check_held(what: str, context: Any) -> None:
    """Refuses a stream whose decoder can take too much memory.

    Args:
        what: Name of the video in the error.
        context: As in `held_bytes`.

    Raises:
        CaptureError: If its pictures can take more than `MOST_BYTES`.
    """
    if held_bytes(context) > MOST_BYTES:
        raise CaptureError.of("costly", f"{what}: ")


def set_threads(context: Any) -> None:
    """Gives a decoder as many threads as this process may use, fewer where its pictures are large.

    Args:
        context: PyAV's context of a stream of pictures, not yet decoded.
    """
    context.thread_count = 1
    left = MOST_BYTES - held_bytes(context)
    more = left // _picture_bytes(context) if _picture_bytes(context) else MOST_THREADS
    context.thread_count = max(1, min(_processors() + 1, MOST_THREADS, 1 + more))


def _picture_bytes(context: Any) -> int:
    """Bytes of one picture; 0 where the stream has not told its kind."""
    if context.format is None:
        return 0
    return context.width * context.height * context.format.padded_bits_per_pixel // 8


def _processors() -> int:
    """How many processors this process may use."""
    alone = hasattr(os, "sched_getaffinity")
    return len(os.sched_getaffinity(0)) if alone else os.cpu_count() or 1
