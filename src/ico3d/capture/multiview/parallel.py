"""Work on all pictures of a capture, one thread for a camera at a time."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from ico3d.capture.multiview.writing import shown

View = Callable[[int], int]
"""Does something with a frame of one camera, and gives a count."""


def each_camera(
    start: Callable[[int], View], cameras: Sequence[int], num_frames: int, workers: int, what: str
) -> int:
    """Calls a function for every view, a camera's frames in order: videos are decoded once.

    Args:
        start: Gives the function for a camera, with all it needs opened for it alone.
        cameras: Numbers of the cameras.
        num_frames: Frames of each.
        workers: Threads.
        what: What the progress bar says.

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
