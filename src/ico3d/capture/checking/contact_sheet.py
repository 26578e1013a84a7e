"""The contact sheet: one picture by which people judge whether a capture is sound."""

from itertools import pairwise

import numpy as np
from PIL import Image, ImageDraw

from ico3d.capture.capture import Capture, Sound
from ico3d.capture.checking.skeleton import draw_skeleton
from ico3d.rig.body_track import BodyTrack

TILE = 256
COLUMNS = 6
AXIS = 0.1
"""Length of the drawn axes of the head, metres."""


def contact_sheet(capture: Capture, views: list[tuple[int, int]]) -> Image.Image:
    """Draws some views with all known data, the background, and the sound.

    A view shows landmarks, outlines of masks, axes of the head, the skeleton and the outline of its
    surface.

    Args:
        capture: An open capture.
        views: Pairs (camera, frame) that have pictures.
    """
    track = capture.body_track()
    tiles = [_view(capture, track, camera, frame) for camera, frame in views]
    plate = capture.background(0)
    if plate is not None:
        tiles.append(_labelled(_picture(plate), "background"))
    rows = -(-len(tiles) // COLUMNS)
    sound = capture.audio()
    strip = 0 if sound is None else 96
    sheet = Image.new("RGB", (COLUMNS * TILE, rows * TILE + strip), (24, 24, 24))
    for number, tile in enumerate(tiles):
        sheet.paste(tile, (number % COLUMNS * TILE, number // COLUMNS * TILE))
    if sound is not None:
        times = [frame / capture.fps for _, frame in views]
        wave = _waveform(sound, capture.num_frames / capture.fps, times, COLUMNS * TILE, strip)
        sheet.paste(wave, (0, rows * TILE))
    return sheet


def _view(capture: Capture, track: BodyTrack | None, camera: int, frame: int) -> Image.Image:
    """One picture with everything known about it, as a tile."""
    image = capture.image(camera, frame)
    assert image is not None  # the caller chose views that have one
    mask, head = capture.mask(camera, frame), capture.head_mask(camera, frame)
    drawn = image.copy()
    for area, colour in ((mask, (0, 1, 0)), (head, (1, 1, 0))):
        if area is not None:
            drawn[_outline(area > 0.5)] = colour
    picture = _picture(drawn)
    if track is not None:
        picture = draw_skeleton(picture, track, capture.cameras[camera], frame)
    scale = picture.width / image.shape[1], picture.height / image.shape[0]
    draw = ImageDraw.Draw(picture)
    marks = capture.landmarks(camera, frame)
    for x, y in [] if marks is None else marks * scale:
        draw.ellipse((x - 1.5, y - 1.5, x + 0.5, y + 0.5), fill=(255, 60, 60))
    _draw_axes(draw, capture, camera, frame, np.array(scale))
    return _labelled(picture, f"{frame}" + (f" / {camera}" if len(capture.cameras) > 1 else ""))


def _draw_axes(
    draw: ImageDraw.ImageDraw, capture: Capture, camera: int, frame: int, scale: np.ndarray
) -> None:
    """Head axes from the origin: x red, y green, z blue."""
    pose = capture.world_from_head(frame)
    if pose is None:
        return
    ends = np.concatenate([np.zeros((1, 3)), AXIS * np.eye(3)])
    pixels, depths = capture.cameras[camera].moved(pose).project(ends)
    if (depths <= 0).any():
        return
    origin, *tips = (pixels * scale).tolist()
    for tip, colour in zip(tips, ((255, 0, 0), (0, 220, 0), (60, 120, 255)), strict=True):
        draw.line((*origin, *tip), fill=colour, width=2)


def _outline(mask: np.ndarray) -> np.ndarray:
    """(H, W) bool: pixels of a mask with a neighbour outside."""
    padded = np.pad(mask, 1, mode="edge")
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return mask & ~inner


def _picture(image: np.ndarray) -> Image.Image:
    """Float RGB in [0, 1] as a picture that fits into a tile."""
    picture = Image.fromarray((np.clip(image, 0, 1) * 255).round().astype(np.uint8))
    picture.thumbnail((TILE, TILE))
    return picture


def _labelled(picture: Image.Image, text: str) -> Image.Image:
    """The picture in a tile with a caption."""
    tile = Image.new("RGB", (TILE, TILE))
    tile.paste(picture, (0, 0))
    ImageDraw.Draw(tile).text(
        (4, TILE - 14), text, fill=(255, 255, 255), stroke_width=1, stroke_fill=0
    )
    return tile


def _waveform(
    sound: Sound, seconds: float, times: list[float], width: int, height: int
) -> Image.Image:
    """Peaks of the sound over the length of the pictures, the shown frames marked."""
    strip = Image.new("RGB", (width, height))
    draw = ImageDraw.Draw(strip)
    edges = np.linspace(0, seconds * sound.rate, width + 1).astype(int)
    for column, (start, stop) in enumerate(pairwise(edges)):
        part = sound.samples[start : max(stop, start + 1)]
        low, high = (part.min(), part.max()) if len(part) else (0.0, 0.0)
        middle, half = height / 2, height / 2 - 2
        draw.line((column, middle - half * high, column, middle - half * low), fill=(120, 200, 255))
    for time in times:
        draw.line((time / seconds * width, 0, time / seconds * width, 6), fill=(255, 200, 0))
    return strip
