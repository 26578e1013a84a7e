"""Processes all pictures of a capture in parallel, each camera in one thread."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from ico3d.capture.multiview.writing import shown

View = Callable[[int], int]
"""Function that processes a frame of one camera and returns a count."""


def each_camera(
    start: Callable[[int], View], cameras: Sequence[int], num_frames: int, workers: int, what: str
) -> int:
    """Processes every view, each camera's frames in order, so that videos are decoded once.

    Args:
        start: Returns the function for a camera, which opens files for itself alone.
        cameras: Indices of the cameras.
        num_frames: Number of frames of each camera.
        workers: Number of threads.
        what: Label of the progress bar.

    Returns:
        The sum of the counts.
    """
    stop = threading.Event()

    def one_camera(camera: int) -> int:
        total = 0
        try:
            view = start(camera)
            for frame in range(num_frames):
                if stop.is_set():
                    break
                total += view(frame)
                advance()
        except BaseException:
            stop.set()  # the others need not go on to the end of their camera
            raise
        return total

    with shown(what, len(cameras) * num_frames) as advance, ThreadPoolExecutor(workers) as pool:
        return sum(pool.map(one_camera, cameras))
