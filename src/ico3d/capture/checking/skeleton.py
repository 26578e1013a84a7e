"""Draws a body track over pictures: bones, and the outline of the template's surface."""

import numpy as np
from PIL import Image, ImageDraw
from scipy.ndimage import binary_dilation, binary_erosion

from ico3d.common.camera import Camera
from ico3d.rig.body_track import BodyTrack

BONE, OUTLINE, GUESSED = (255, 80, 220), (0, 220, 255), (255, 160, 0)
"""Colours of bones, of the template's outline, and of bones in interpolated frames."""
SHARP = 2
"""Resolution at which the outline is found, as a factor of the picture's."""


def draw_skeleton(
    picture: Image.Image, track: BodyTrack, camera: Camera, frame: int
) -> Image.Image:
    """Draws bones and the template's outline over a picture.

    Args:
        picture: A picture of any size with the camera's aspect ratio.
        track: The motion of the body.
        camera: The camera that took the picture.
        frame: Frame of the picture.
    """
    lens = camera.resized(*picture.size)
    outline = _outline(track, lens, frame)
    pixels = np.asarray(picture.convert("RGB")).copy()
    pixels[outline] = OUTLINE
    drawn = Image.fromarray(pixels)
    draw = ImageDraw.Draw(drawn)
    places, depths = lens.project(track.joints()[frame])
    colour = BONE if track.fitted[frame] else GUESSED
    for joint, parent in enumerate(track.rig.parents):
        if parent >= 0 and min(depths[joint], depths[parent]) > 0:
            draw.line((*places[parent].tolist(), *places[joint].tolist()), fill=colour)
    return drawn


def _outline(track: BodyTrack, lens: Camera, frame: int) -> np.ndarray:
    """(H, W) bool: pixels on the outline of the template's surface."""
    fine = lens.resized(SHARP * lens.width, SHARP * lens.height)
    corners, depths = fine.project(track.surface(frame))  # (V, 2), (V,)
    covered = Image.new("1", (fine.width, fine.height))
    draw = ImageDraw.Draw(covered)
    for face in track.faces[(depths[track.faces] > 0).all(1)]:
        draw.polygon([tuple(corner) for corner in corners[face].tolist()], fill=1)
    # Triangles of less than a pixel leave gaps: closed before the border is taken.
    solid = np.asarray(binary_erosion(binary_dilation(np.asarray(covered))))
    rim = solid & ~np.asarray(binary_erosion(solid, border_value=1), bool)
    blocks = rim.reshape(lens.height, SHARP, lens.width, SHARP)
    return np.any(blocks, (1, 3))
