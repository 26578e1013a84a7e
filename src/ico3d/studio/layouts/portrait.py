"""Writes any capture as a talking-portrait folder, as the tools of AD-NeRF's layout do.

What such tools make and other programs read goes in: pictures, landmarks, parts of the person,
torso and clean plate, poses, blendshapes, sound. What they do not know, such as exact masks and
points on the surface, stays out.
"""

import json
from pathlib import Path

import numpy as np
import soundfile
from rich.progress import track

from ico3d.capture.capture import EYE_NAMES, Capture
from ico3d.capture.decoding import to_bytes
from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.portrait import parsing
from ico3d.capture.portrait.files import (
    DETAILS,
    OPENGL_FROM_OPENCV,
    save_landmarks,
    save_picture,
    save_torso,
    save_transforms,
)
from ico3d.errors import CaptureError

JAW, BROWS, INNER_LIPS = slice(0, 17), slice(17, 27), slice(60, 68)
"""Multi-PIE landmarks from ear to ear along the chin, of the brows, and of the mouth's opening."""
CHIN, FOREHEAD = 8, 27
NECK = (0.9, 0.55)
"""Width of the neck, as a share of the jaw's, and its length below the chin, as a share of the
distance from the bridge of the nose to the chin."""


def write_portrait(capture: Capture, folder: Path, camera: int = 0) -> Path:
    """Writes what one camera saw as a talking-portrait folder.

    The last 1/11 of the frames are for tests. Parts of the person follow from the landmarks: the
    face within jaw and brows, hair elsewhere above the jaw, neck and cloth below.

    Args:
        capture: A capture with masks, head poses, landmarks, eye values and a clean plate.
        folder: The folder to write.
        camera: Index of the camera, which must have recorded every frame.

    Returns:
        The folder.

    Raises:
        CaptureError: If something is missing.
    """
    frames = list(range(capture.num_frames))
    plate = _needed(capture.background(camera), capture, "clean plate", camera, 0)
    save_picture(folder / "bc.jpg", to_bytes(np.clip(plate, 0, 1)))
    poses = np.stack([_pose(capture, camera, frame) for frame in frames])  # (F, 4, 4)
    for frame in track(frames, "writing", transient=True):
        _write_frame(capture, folder, camera, frame)
    lens = capture.cameras[camera].intrinsics
    save_transforms(folder, float(lens[0, 0]), (lens[0, 2], lens[1, 2]), frames, poses)
    np.save(folder / "bs.npy", _blendshapes(capture))
    sound = capture.audio()
    if sound is not None:
        soundfile.write(folder / "aud.wav", sound.samples, sound.rate, subtype="PCM_16")
    details = {"fps": capture.fps, "provenance": capture.provenance}
    (folder / DETAILS).write_text(json.dumps(details, indent=1))
    return folder


def _write_frame(capture: Capture, folder: Path, camera: int, frame: int) -> None:
    """Picture, landmarks, parts and torso of a frame."""
    recorded = _needed(capture.image(camera, frame), capture, "picture", camera, frame)
    mask = _needed(capture.mask(camera, frame), capture, "mask", camera, frame)
    landmarks = _needed(capture.landmarks(camera, frame), capture, "landmarks", camera, frame)
    image, parts = to_bytes(np.clip(recorded, 0, 1)), parted(mask, landmarks)
    torso = mask * parsing.is_class(parts, parsing.NECK, parsing.CLOTH)
    for name in ("ori_imgs", "gt_imgs"):
        save_picture(folder / name / f"{frame}.jpg", image)
    save_picture(folder / "parsing" / f"{frame}.png", parts)
    (folder / "torso_imgs").mkdir(exist_ok=True)
    save_torso(folder / "torso_imgs" / f"{frame}.png", image, torso)
    save_landmarks(folder / "ori_imgs" / f"{frame}.lms", landmarks)


def parted(mask: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """The layout's parsing picture of a person.

    Args:
        mask: (H, W) of the person in [0, 1].
        landmarks: (68, 2) Multi-PIE landmarks, pixels.

    Returns:
        (H, W, 3) uint8 colours of the parts.
    """
    person, (height, width) = mask > 0.5, mask.shape
    columns, rows = np.arange(width) + 0.5, np.arange(height)[:, None] + 0.5
    jaw = landmarks[JAW][landmarks[JAW][:, 0].argsort()]
    chin, tall = landmarks[CHIN], landmarks[CHIN, 1] - landmarks[FOREHEAD, 1]
    beside = chin[1] - 0.1 * tall  # where hair hangs beside the face
    line = np.interp(columns, jaw[:, 0], jaw[:, 1], left=beside, right=beside)
    below = rows > np.maximum(line, beside)  # (H, W)
    aside = np.abs(columns - chin[0])[None] > NECK[0] / 2 * np.ptp(jaw[:, 0])
    cloth = aside | (rows > chin[1] + NECK[1] * tall)
    parts = np.full((height, width, 3), parsing.BACKGROUND, np.uint8)
    parts[person & ~below] = parsing.HAIR
    parts[person & below & ~cloth] = parsing.NECK
    parts[person & below & cloth] = parsing.CLOTH
    outline = np.concatenate([landmarks[JAW], landmarks[BROWS][::-1]])
    parts[parsing.filled(mask.shape, outline) & person] = parsing.FACE
    parts[parsing.filled(mask.shape, landmarks[INNER_LIPS])] = parsing.MOUTH
    return parts


def _pose(capture: Capture, camera: int, frame: int) -> np.ndarray:
    """(4, 4) camera from head, OpenGL axes."""
    pose = _needed(capture.world_from_head(frame), capture, "head pose", camera, frame)
    return OPENGL_FROM_OPENCV @ capture.cameras[camera].world_to_camera @ pose


def _blendshapes(capture: Capture) -> np.ndarray:
    """(F, 52) float32: the capture's values where the names agree, else 0."""
    table = np.zeros((capture.num_frames, len(BLENDSHAPES)), np.float32)
    names = capture.blendshape_names or ()
    for frame, row in enumerate(table):
        values = capture.blendshapes(frame)
        known = {} if values is None else dict(zip(names, values, strict=True))
        eyes = capture.eyes(frame)
        known |= {} if eyes is None else dict(zip(EYE_NAMES, eyes, strict=True))
        row[:] = [known.get(name, 0.0) for name in BLENDSHAPES]
    return table


def _needed(
    found: np.ndarray | None, capture: Capture, what: str, camera: int, frame: int
) -> np.ndarray:
    if found is None:
        raise CaptureError(
            f"{capture.path} has no {what} of camera {camera} in frame {frame}: a portrait needs "
            "it in every frame."
        )
    return found
