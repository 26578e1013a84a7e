"""Writes any capture as the SMC files of DNA-Rendering and RenderMe-360, as if recorded there.

What such files hold and synthetic captures know goes in: pictures, masks, calibration, landmarks,
sound. Worlds have +y down and pixel centres lie at whole numbers, as in the data sets.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from ico3d.capture.capture import Capture
from ico3d.capture.decoding import to_bytes
from ico3d.capture.renderme.flame import VERTICES
from ico3d.capture.renderme.landmarks import MULTI_PIE, POINTS
from ico3d.common.camera import Camera

DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
"""Takes a world with +y up to that of the files."""
KEYPOINTS, FACE = 133, slice(23, 91)
"""COCO-WholeBody's, and those of the face among them."""
FIRST_FRONTAL = 18
"""RenderMe-360 has landmarks of cameras 18 to 32; 25 looks straight at the face."""
HEAD_BOX = (0.16, 0.20, 0.18)
"""Metres that a fitted face model fills, from the crown down."""
SHIFT = np.array([0.03, -0.4, 0.2])
"""Translation of a fit in metres: the files hold vertices without it."""


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
    with _renderme_files(capture, folder, name) as notes:
        for index, camera in enumerate(capture.cameras):
            for frame in range(capture.num_frames):
                marks = np.zeros((POINTS, 2))
                marks[MULTI_PIE] = camera.project(_face(capture, frame))[0] - 0.5
                notes[f"Keypoints2d/{FIRST_FRONTAL + index:02d}/{frame}"] = marks
    return folder


def write_renderme_fits(capture: Capture, folder: Path, name: str) -> Path:
    """A part of RenderMe-360 with speech and FLAME, but without landmarks; returns the folder.

    All that it tells of the person's surface are the vertices of the head.
    """
    head = _head_points(capture)  # (V, 3)
    with _renderme_files(capture, folder, name) as notes:
        for frame in range(capture.num_frames):
            pose = capture.world_from_head(frame)
            assert pose is not None, "a synthetic capture knows its head"
            turn, fit = DOWN[:3, :3] @ pose[:3, :3], notes.create_group(f"FLAME/{frame}")
            fit["verts"] = (head @ turn.T + DOWN[:3, :3] @ pose[:3, 3] - SHIFT).astype(np.float32)
            fit["cam"] = np.concatenate([[4700.0], SHIFT])
            fit["global_pose"] = Rotation.from_matrix(turn).as_rotvec()
            fit["neck_pose"] = np.zeros(3)
    return folder


@contextmanager
def _renderme_files(capture: Capture, folder: Path, name: str) -> Iterator[h5py.File]:
    """Writes pictures, mattes, calibration and sound, and gives the annotations for the rest."""
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
        sound = capture.audio()
        if sound is not None:
            raw["Camera/00/audio/audio"] = sound.samples
            raw["Camera/00/audio/sample_rate"] = sound.rate
        yield notes


def _head_points(capture: Capture) -> np.ndarray:
    """(V, 3) of the capture's surface points, those within `HEAD_BOX`, in canonical head space."""
    points = capture.head_points()
    assert points is not None, "a synthetic capture knows its surface"
    across, height, forward = np.abs(points[:, 0]), points[:, 1], points[:, 2]
    upper = height > height.max() - HEAD_BOX[1]
    inside = upper & (across < HEAD_BOX[0] / 2) & (forward > forward[upper].max() - HEAD_BOX[2])
    head = points[inside]
    rng = np.random.default_rng(0)
    return head[rng.choice(len(head), VERTICES, replace=len(head) < VERTICES)].astype(np.float64)


def _write_view(
    capture: Capture, camera: int, frame: int, main: h5py.File, to: str, notes: h5py.File, mask: str
) -> None:
    """A picture and its mask, where the camera took one."""
    image, person = capture.image(camera, frame), capture.mask(camera, frame)
    if image is not None:
        main[to] = _encoded(to_bytes(np.clip(image, 0, 1)), "JPEG")
    if image is not None and person is not None:
        notes[mask] = _encoded(np.repeat(to_bytes(np.clip(person, 0, 1))[..., None], 3, -1), "PNG")


def _write_calibration(file: h5py.File, inside: str, camera: Camera) -> None:
    group, intrinsics = file.create_group(inside), camera.intrinsics.copy()
    intrinsics[:2, 2] -= 0.5
    group["K"], group["D"], group["RT"] = intrinsics, np.zeros(5), DOWN @ camera.camera_to_world


def _face(capture: Capture, frame: int) -> np.ndarray:
    """(68, 3) landmarks in the world."""
    pose, marks = capture.world_from_head(frame), capture.landmarks_3d(frame)
    assert pose is not None and marks is not None, "a synthetic capture knows its head"
    return marks @ pose[:3, :3].T + pose[:3, 3]


def _encoded(picture: np.ndarray, kind: str) -> np.ndarray:
    """1-D uint8."""
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, kind, quality=95)
    return np.frombuffer(stream.getvalue(), np.uint8)
