"""Tracks of faces through a video, and the pictures of the face that SyncNet looks at."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ico3d.measure.sync.network import SIDE

OVERLAP = 0.5
"""Least overlap (intersection over union) of a face with that of the frame before."""
MOST_MISSING = 25
"""Frames from one detection of a face to the next at most."""
MORE_THAN = 100
"""A track has more detections, and its face more pixels on average, than this."""
MARGIN = 0.4
"""Share of the box's half side that a crop adds at the sides, and twice that below."""
MEDIAN = 13
"""Frames over which boxes are median-filtered."""
GREY = 110


@dataclass(frozen=True)
class Track:
    """A face in consecutive frames.

    Attributes:
        first: The first frame.
        boxes: (T, 4) left, top, right and bottom in pixels; between detections, interpolated.
    """

    first: int
    boxes: np.ndarray

    @property
    def stop(self) -> int:
        """The frame after the last one."""
        return self.first + len(self.boxes)


def tracks_of(faces: Sequence[np.ndarray]) -> list[Track]:
    """Follows faces through a video, as the published pipeline does within a shot.

    Args:
        faces: Boxes (F, 4) of each frame.

    Returns:
        Tracks of more than `MORE_THAN` detections whose mean width or height is more than
        `MORE_THAN` pixels, in the order in which they were begun.
    """
    left = [list(boxes) for boxes in faces]
    tracks = []
    while any(left):
        places, boxes = _follow(left)
        if len(places) <= MORE_THAN:
            continue
        steps = np.arange(places[0], places[-1] + 1)
        sides = np.array(boxes).T  # (4, detections)
        filled = np.stack([np.interp(steps, places, side) for side in sides], 1)  # (T, 4)
        if (filled[:, 2:] - filled[:, :2]).mean(0).max() > MORE_THAN:
            tracks.append(Track(places[0], filled))
    return tracks


def _follow(left: list[list[np.ndarray]]) -> tuple[list[int], list[np.ndarray]]:
    """Takes the faces of one person out of `left`: the frames and the boxes."""
    places: list[int] = []
    boxes: list[np.ndarray] = []
    for frame, faces in enumerate(left):
        if places and frame - places[-1] > MOST_MISSING:
            break
        for k, face in enumerate(faces):
            if not boxes or overlap(face, boxes[-1]) > OVERLAP:
                places.append(frame)
                boxes.append(face)
                del faces[k]
                break
    return places, boxes


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two boxes (left, top, right, bottom)."""
    sides = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
    common = np.maximum(sides, 0).prod()
    areas = (a[2:] - a[:2]).prod() + (b[2:] - b[:2]).prod()
    return float(common / (areas - common))


class Crops:
    """Cuts the pictures of a face out of the frames of its track."""

    def __init__(self, track: Track):
        """Takes the track."""
        from scipy.signal import medfilt  # takes long to import

        width, height = (track.boxes[:, 2:] - track.boxes[:, :2]).T
        middle = (track.boxes[:, :2] + track.boxes[:, 2:]) / 2  # (T, 2)
        series = (np.maximum(width, height) / 2, middle[:, 0], middle[:, 1])
        # (T,) half of the side, column and row of the middle; ends are filtered with zeros around
        self._half, self._column, self._row = (medfilt(values, MEDIAN) for values in series)

    def cut(self, picture: np.ndarray, place: int) -> np.ndarray:
        """The face in a frame.

        Args:
            picture: uint8 (H, W, 3), any order of colours.
            place: Index of the frame in the track.

        Returns:
            uint8 (224, 224, 3).
        """
        half, column, row = self._half[place], self._column[place], self._row[place]
        pad = int(half * (1 + 2 * MARGIN))
        column, row = column + pad, row + pad
        top, bottom = int(row - half), int(row + half * (1 + 2 * MARGIN))
        left, right = int(column - half * (1 + MARGIN)), int(column + half * (1 + MARGIN))
        border = ((pad, pad), (pad, pad), (0, 0))
        padded = np.pad(picture, border, constant_values=GREY)
        return resized(padded[max(top, 0) : bottom, max(left, 0) : right], SIDE, SIDE)


def resized(picture: np.ndarray, height: int, width: int) -> np.ndarray:
    """A picture (H, W, C) uint8 at another size, interpolated linearly between pixel centres.

    Nothing is averaged where the picture becomes smaller: so do the published programs, by OpenCV.
    """
    values = picture.astype(np.float32)
    for axis, count in ((0, height), (1, width)):
        length = picture.shape[axis]
        places = ((np.arange(count) + 0.5) * length / count - 0.5).clip(0, length - 1)
        before = np.minimum(places.astype(int), max(length - 2, 0))
        share = (places - before).astype(np.float32)
        share = share[:, None, None] if axis == 0 else share[None, :, None]
        after = np.minimum(before + 1, length - 1)
        values = values.take(before, axis) * (1 - share) + values.take(after, axis) * share
    return (values + 0.5).astype(np.uint8)
