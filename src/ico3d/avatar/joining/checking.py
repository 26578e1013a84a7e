"""Pictures with which people check that a head is where it belongs."""

from pathlib import Path

import numpy as np
import torch
from PIL import Image

from ico3d.avatar.avatar import HEAD, PLACEMENT, load_placement
from ico3d.avatar.joining.face_views import FaceView, face_views
from ico3d.avatar.joining.similarity import moved
from ico3d.capture.capture import Capture
from ico3d.capture.face.region import HeadRegion
from ico3d.common.files import write_one_of_many
from ico3d.errors import ModelError
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.device import CPU
from ico3d.splat.render import render

PICTURES = 12
"""Most pictures that are written."""
LEAST_HEIGHT = 256
"""Height in pixels to which smaller pictures are enlarged at least."""
MARK = (0.1, 1.0, 0.3)
"""RGB of the pixels at landmarks."""


def write_checks(folder: Path, capture: Capture, out: Path, device: torch.device = CPU) -> None:
    """Writes pictures `FRAME_CAMERA.png`: recorded | with the head drawn over | with landmarks.

    Args:
        folder: The avatar's folder, with its head and placement.
        capture: The body's recording.
        out: Folder to write into.
        device: Where to draw.

    Raises:
        CaptureError: If no camera sees the face.
        ModelError: If the folder lacks the head, its landmarks or the placement.
    """
    head = TrainedHead.load(folder / HEAD).to(device)
    placement, expressions = load_placement(folder / PLACEMENT)
    if head.landmarks is None:
        raise ModelError(f"{folder / HEAD} has no landmarks: assemble the avatar again.")
    region, everybody = HeadRegion.around(head.landmarks), list(range(len(capture.cameras)))
    views = face_views(capture, placement, region, head.landmarks, everybody, PICTURES)
    out.mkdir(parents=True, exist_ok=True)
    for view in views:
        where = placement.world_from_head(view.frame)
        with torch.no_grad():
            drawn = head.model(torch.from_numpy(expressions[view.frame])).transform(where)
            over = render(drawn, [view.camera], view.image).rgb[0].cpu().numpy()
        marked = _marked(view, moved(where, head.landmarks))
        row = np.hstack([view.image.numpy(), over, marked])
        name = f"{view.frame:06d}_{capture.cameras[view.camera_index].name}.png"
        write_one_of_many(out / name, _enlarged(row).save)


def _marked(view: FaceView, points: np.ndarray) -> np.ndarray:
    """(H, W, 3) picture of a view with points (P, 3) of the world marked in it."""
    picture = view.image.numpy().copy()
    pixels = np.floor(view.camera.project(points)[0]).astype(int)  # (P, 2)
    inside = ((pixels >= 0) & (pixels < (view.camera.width, view.camera.height))).all(1)
    picture[pixels[inside, 1], pixels[inside, 0]] = MARK
    return picture


def _enlarged(picture: np.ndarray) -> Image.Image:
    image = Image.fromarray((picture.clip(0, 1) * 255 + 0.5).astype(np.uint8))
    factor = max(1, -(-LEAST_HEIGHT // image.height))
    return image.resize((image.width * factor, image.height * factor), Image.Resampling.LANCZOS)
