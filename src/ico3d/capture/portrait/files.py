"""Reads and writes files of the talking-portrait layout (AD-NeRF, SyncTalk, TalkingGaussian)."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from ico3d.capture.decoding import open_picture
from ico3d.capture.writing.new_folder import check_left
from ico3d.common.files import read_small
from ico3d.errors import CaptureError

DETAILS = "ico3d.json"
"""File for data that have no place in the talking-portrait layout."""
MOST_LANDMARKS = 1 << 16
"""Bytes of a file of landmarks; they have about two thousand."""
OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


def save_picture(path: Path, image: np.ndarray) -> None:
    """Writes uint8 RGB(A) or grey; JPEGs without chroma subsampling.

    Raises:
        StorageError: If the disk is nearly full.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    check_left(path.parent)
    picture = Image.fromarray(image)
    if path.suffix == ".jpg":
        picture.save(path, quality=97, subsampling=0)
    else:
        picture.save(path, compress_level=3)


def save_landmarks(path: Path, landmarks: np.ndarray) -> None:
    """Writes landmarks (68, 2) in pixels as text, one line "x y" each."""
    path.write_text("".join(f"{x:.4f} {y:.4f}\n" for x, y in landmarks))


def load_landmarks(path: Path) -> np.ndarray:
    """Reads landmarks (68, 2) in pixels.

    Raises:
        OSError: If the file is not there, or no small one.
        ValueError: If it holds something else than numbers.
    """
    lines = read_small(path, most=MOST_LANDMARKS).decode().splitlines()
    return np.loadtxt(lines, dtype=np.float64).reshape(-1, 2)


def camera_to_world(camera_from_head: np.ndarray) -> np.ndarray:
    """The layout's `transform_matrix` (4, 4): the head is fixed in the world, the camera moves.

    Args:
        camera_from_head: (4, 4) rigid head pose, OpenGL camera axes.
    """
    rotation, translation = camera_from_head[:3, :3], camera_from_head[:3, 3]
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.T
    matrix[:3, 3] = -rotation.T @ translation
    return matrix


def save_transforms(
    folder: Path,
    focal: float,
    center: Sequence[float],
    frames: Sequence[int],
    poses: np.ndarray,
) -> None:
    """Writes `transforms_train.json` and `transforms_val.json` (the last 1/11 of the frames).

    Args:
        folder: The capture.
        focal: Focal length in pixels.
        center: Principal point in pixels.
        frames: Numbers of the frames with a face, ascending.
        poses: (len(frames), 4, 4) camera from head, OpenGL axes.
    """
    first_test = len(frames) * 10 // 11
    for name, part in (("train", slice(0, first_test)), ("val", slice(first_test, None))):
        entries = [
            {"img_id": int(i), "aud_id": int(i), "transform_matrix": camera_to_world(p).tolist()}
            for i, p in zip(frames[part], poses[part], strict=True)
        ]
        content = {"focal_len": focal, "cx": center[0], "cy": center[1], "frames": entries}
        (folder / f"transforms_{name}.json").write_text(json.dumps(content, indent=1))


def save_torso(path: Path, image: np.ndarray, torso: np.ndarray) -> None:
    """Writes the torso as RGBA; transparent pixels are black.

    Args:
        path: The PNG file.
        image: uint8 RGB (H, W, 3).
        torso: (H, W) float32 alpha of neck and cloth.
    """
    alpha = (torso * 255).round().astype(np.uint8)[..., None]
    save_picture(path, np.concatenate([image * (alpha > 0), alpha], -1))


def load_uint8(path: Path) -> np.ndarray:
    """A picture as uint8."""
    with open_picture(path, str(path)) as picture:
        return np.asarray(picture)


def stated_in(details: dict, where: str) -> dict:
    """The provenance that `ico3d.json` states, as far as it does.

    Args:
        details: Its content.
        where: Its path, for errors.

    Raises:
        CaptureError: If something that it states is no text, or the sources are no list of texts.
    """
    stated = details.get("provenance", {})
    if not isinstance(stated, dict):
        raise CaptureError(f"{where}: provenance must be an object.")
    for name in ("kind", "likeness", "consent", "licence"):
        if not isinstance(stated.get(name, ""), str):
            raise CaptureError(f"{where}: provenance.{name} must be a text.")
    sources = stated.get("sources", [])
    if not isinstance(sources, list) or not all(isinstance(name, str) for name in sources):
        raise CaptureError(f"{where}: provenance.sources must be a list of texts.")
    return stated
