"""The contact sheet of a tracked head, by which people judge the track."""

import io
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from ico3d.capture.capture import Capture
from ico3d.capture.headpose.track_file import HeadTrack
from ico3d.capture.headtrack.crops import READ_AT, Part, around
from ico3d.common.files import write_atomic
from ico3d.common.spread import spread
from ico3d.errors import SettingsError

FRAMES, CAMERAS = 6, 4
"""Number of rows, and highest number of columns."""
SHOWN = 0.34
"""Size of what a tile shows, metres."""
AXIS = 0.1
"""Length of the drawn axes of the head, metres."""
COLOURS = ((255, 60, 60), (60, 220, 60), (80, 150, 255))
"""Colours in which the head's axes x, y and z are drawn."""
FORMATS = {".jpg": "JPEG", ".jpeg": "JPEG", ".png": "PNG"}


def write_sheet(capture: Capture, track: HeadTrack, path: Path) -> None:
    """Draws landmarks and axes of the head over pictures; a row for each frame.

    Args:
        capture: The recording.
        track: The track of the recording.
        path: The picture to write.

    Raises:
        SettingsError: If the file's suffix is not that of a JPEG or PNG.
    """
    check_name(path)
    known = np.flatnonzero(track.tracked)
    frames = known[spread(len(known), FRAMES)]
    rows = [_row(capture, track, int(frame)) for frame in frames]
    width = max(len(row) for row in rows) * READ_AT
    sheet = Image.new("RGB", (width, len(rows) * READ_AT), (24, 24, 24))
    for y, row in enumerate(rows):
        for x, tile in enumerate(row):
            sheet.paste(tile, (x * READ_AT, y * READ_AT))
    stream = io.BytesIO()
    sheet.save(stream, FORMATS[path.suffix.lower()], quality=90)
    write_atomic(path, stream.getvalue())


def check_name(path: Path) -> None:
    """Checks that a contact sheet can be written under a name.

    Raises:
        SettingsError: If the suffix is not that of a JPEG or PNG.
    """
    if path.suffix.lower() not in FORMATS:
        raise SettingsError(f"{path}: name the contact sheet .jpg or .png.")


def _row(capture: Capture, track: HeadTrack, frame: int) -> list[Image.Image]:
    """One frame in cameras that saw the face, evenly chosen."""
    seen = np.flatnonzero(track.views[frame])
    chosen = seen[spread(len(seen), CAMERAS)]
    return [_tile(capture, track, int(camera), frame) for camera in chosen]


def _tile(capture: Capture, track: HeadTrack, camera: int, frame: int) -> Image.Image:
    """The head in one picture."""
    lens = capture.cameras[camera].moved(track.world_from_head[frame])
    part = around(lens, np.zeros(3), SHOWN)
    image = capture.image(camera, frame)
    assert part is not None and image is not None  # the camera saw the face
    tile = Image.fromarray(part.cut(image))
    draw = ImageDraw.Draw(tile)
    for x, y in _drawn(part, lens.project(track.landmarks[frame])[0]):
        draw.ellipse((x - 2, y - 2, x + 2, y + 2), fill=(255, 220, 0))
    ends = np.concatenate([np.zeros((1, 3)), AXIS * np.eye(3)])
    origin, *tips = map(tuple, _drawn(part, lens.project(ends)[0]))
    for tip, colour in zip(tips, COLOURS, strict=True):
        draw.line((*origin, *tip), fill=colour, width=3)
    text = f"frame {frame}, camera {lens.name}"
    draw.text((6, READ_AT - 18), text, fill=(255, 255, 255), stroke_width=1, stroke_fill=0)
    return tile


def _drawn(part: Part, pixels: np.ndarray) -> list[list[float]]:
    """Where pixels of the picture lie in the tile."""
    return ((pixels - (part.left, part.top)) * (READ_AT / part.side)).tolist()
