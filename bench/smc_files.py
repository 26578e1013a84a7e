"""Writes any capture as the SMC files of DNA-Rendering and RenderMe-360, as if recorded there.

What such files hold and synthetic captures know goes in: pictures, masks, calibration, landmarks,
sound. Worlds have +y down and pixel centres lie at whole numbers, as in the data sets.
"""

import io
from pathlib import Path

import h5py
import numpy as np
from PIL import Image

from ico3d.capture.capture import Capture
from ico3d.capture.renderme.landmarks import MULTI_PIE, POINTS
from ico3d.common.camera import Camera

DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
"""Takes a world with +y up to that of the files."""
KEYPOINTS, FACE = 133, slice(23, 91)
"""COCO-WholeBody's, and those of the face among them."""
FIRST_FRONTAL = 18
"""RenderMe-360 has landmarks of cameras 18 to 32; 25 looks straight at the face."""


def write_dna(capture: Capture, folder: Path, name: str) -> Path:
    """A DNA-Rendering recording of a whole person; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with (
        h5py.File(folder / f"{name}.smc", "w") as main,
        h5py.File(folder / f"{name}_annots.smc", "w") as notes,
    ):
        main.attrs["gender"] = "female"
        main.create_group("Camera_5mp").attrs["num_frame"] = capture.num_frames
        for index, camera in enumerate(capture.cameras):
            _write_calibration(notes, f"Camera_Parameter/{index:02d}", camera)
            for frame in range(capture.num_frames):
                place = f"Camera_5mp/{index}/color/{frame}"
                _write_view(capture, index, frame, main, place, notes, f"Mask/{index}/mask/{frame}")
        points = np.full((capture.num_frames, KEYPOINTS, 3), np.nan)
        for frame in range(capture.num_frames):
            points[frame, FACE] = _face(capture, frame) @ DOWN[:3, :3].T
        notes["Keypoints_3D/keypoints3d"] = points
    return folder


def write_renderme(capture: Capture, folder: Path, name: str) -> Path:
    """A part of RenderMe-360 with speech and without FLAME; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with (
        h5py.File(folder / f"{name}_raw.smc", "w") as raw,
        h5py.File(folder / f"{name}_anno.smc", "w") as notes,
    ):
        raw.create_group("Camera").attrs["num_frame"] = capture.num_frames
        for index, camera in enumerate(capture.cameras):
            label = f"{FIRST_FRONTAL + index:02d}"
            _write_calibration(notes, f"Calibration/{label}", camera)
            for frame in range(capture.num_frames):
                inside = f"Camera/{label}/{{}}/{frame}"
                parts = raw, inside.format("color"), notes, inside.format("mask")
                _write_view(capture, index, frame, *parts)
                marks = np.zeros((POINTS, 2))
                marks[MULTI_PIE] = camera.project(_face(capture, frame))[0] - 0.5
                notes[f"Keypoints2d/{label}/{frame}"] = marks
        sound = capture.audio()
        if sound is not None:
            raw["Camera/00/audio/audio"] = sound.samples
            raw["Camera/00/audio/sample_rate"] = sound.rate
    return folder


def _write_view(
    capture: Capture, camera: int, frame: int, main: h5py.File, to: str, notes: h5py.File, mask: str
) -> None:
    """A picture and its mask, where the camera took one."""
    image, person = capture.image(camera, frame), capture.mask(camera, frame)
    if image is not None:
        main[to] = _encoded(_bytes(image), "JPEG")
    if image is not None and person is not None:
        notes[mask] = _encoded(np.repeat(_bytes(person)[..., None], 3, -1), "PNG")


def _write_calibration(file: h5py.File, inside: str, camera: Camera) -> None:
    group, intrinsics = file.create_group(inside), camera.intrinsics.copy()
    intrinsics[:2, 2] -= 0.5
    group["K"], group["D"], group["RT"] = intrinsics, np.zeros(5), DOWN @ camera.camera_to_world


def _face(capture: Capture, frame: int) -> np.ndarray:
    """(68, 3) landmarks in the world."""
    pose, marks = capture.world_from_head(frame), capture.landmarks_3d(frame)
    assert pose is not None and marks is not None, "a synthetic capture knows its head"
    return marks @ pose[:3, :3].T + pose[:3, 3]


def _bytes(picture: np.ndarray) -> np.ndarray:
    return (np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)


def _encoded(picture: np.ndarray, kind: str) -> np.ndarray:
    """1-D uint8."""
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, kind, quality=95)
    return np.frombuffer(stream.getvalue(), np.uint8)
