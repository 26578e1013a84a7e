"""Writes RenderMe-360 recordings: SMC files in the documented layout, with small pictures."""

import io
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from ico3d.capture.renderme.landmarks import MULTI_PIE
from ico3d.common.camera import Camera, look_at
from support.recordings import faces

FRONTAL = tuple(range(18, 33))
DOWN = np.diag([1.0, -1.0, -1.0])
"""Takes a world with +y up to that of the files, which has +y down, and back."""
ROOT, NECK = np.array([0.01, -0.15, 0.02]), np.array([0.0, -0.1, -0.01])
"""Joints of the face model."""


@dataclass(frozen=True)
class Rig:
    """What is written.

    Attributes:
        cameras: Their numbers.
        frames: How many.
        size: (height, width) of the pictures.
        distortion: k1, k2, p1, p2, k3 of all cameras.
        part: What is performed.
        fitted: Frames with a FLAME fit; none in parts without expressions.
        seen: Whether cameras 18 to 32 have landmarks.
        sound: Samples at 48 kHz, (S,) or (S, 2).
        sound_in: "raw" or "anno".
    """

    cameras: tuple[int, ...] = (0, 18, 22, 25, 28, 32, 45)
    frames: int = 4
    size: tuple[int, int] = (40, 48)
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    part: str = "e0"
    fitted: tuple[int, ...] | None = None
    seen: bool = True
    sound: np.ndarray | None = None
    sound_in: str = "raw"

    def intrinsics(self) -> np.ndarray:
        height, width = self.size
        focal = 1.92 * width
        return np.array([[focal, 0, width / 2 - 1.0], [0, focal + 1, height / 2 + 1.5], [0, 0, 1]])

    def camera_to_world(self, camera: int) -> np.ndarray:
        """RT: a ring of 1.35 m around the head at the origin; camera 25 looks into the face."""
        angle = 2 * np.pi * (camera - 25) / 60
        eye = DOWN @ [1.35 * np.sin(angle), 0.1, 1.35 * np.cos(angle)]
        return np.linalg.inv(look_at(eye, (0, 0, 0), (0, -1, 0)))

    def camera(self, camera: int) -> Camera:
        """In the world of the files, pixel centres at whole numbers."""
        height, width = self.size
        to_camera = np.linalg.inv(self.camera_to_world(camera))
        return Camera(width, height, self.intrinsics(), to_camera)

    def poses(self) -> np.ndarray:
        """(F, 4, 4) of the face model's root in a world with +y up."""
        return faces.motion(self.frames, 30, at=(0, 0, 0), turn=0.2)

    def neck(self) -> np.ndarray:
        """(F, 3) axis-angles."""
        t = np.arange(self.frames)
        return 0.1 * np.stack([np.sin(t), np.cos(t), np.sin(2 * t + 1)], 1)

    def world_from_skull(self) -> np.ndarray:
        """(F, 4, 4): takes the model's head at rest to a world with +y up."""
        turns = Rotation.from_rotvec(self.neck()).as_matrix()
        bent = np.tile(np.eye(4), (self.frames, 1, 1))
        bent[:, :3, :3], bent[:, :3, 3] = turns, NECK - turns @ NECK
        return self.poses() @ bent


def picture(camera: int, frame: int, size: tuple[int, int]) -> np.ndarray:
    """A smooth uint8 RGB picture that differs between cameras and frames."""
    y, x = np.mgrid[: size[0], : size[1]] / max(size)
    waves = [np.sin(9 * x + camera), np.cos(7 * y + frame), np.sin(5 * (x + y) + camera + frame)]
    return np.stack([120 + 100 * w for w in waves], -1).astype(np.uint8)


def matte(size: tuple[int, int]) -> np.ndarray:
    """uint8 (H, W, 3): a disc with a soft edge, only its green channel full."""
    y, x = np.mgrid[: size[0], : size[1]]
    far = np.hypot(y - size[0] / 2, x - size[1] / 2)
    soft = 255 * np.clip((0.35 * size[0] - far) / 4, 0, 1)
    return np.stack([0.3 * soft, soft, 0.5 * soft], -1).astype(np.uint8)


def encoded(image: np.ndarray, kind: str) -> np.ndarray:
    """1-D uint8."""
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, kind, **({"quality": 95} if kind == "JPEG" else {}))
    return np.frombuffer(stream.getvalue(), np.uint8)


def head_at_rest() -> np.ndarray:
    """(5023, 3) points all over an egg with a neck, in the axes of FLAME."""
    index = np.arange(5023) + 0.5
    height = 1 - 2 * index / 5023
    around = np.pi * (1 + 5**0.5) * index
    side = np.sqrt(1 - height**2)
    ball = np.stack([side * np.sin(around), height, side * np.cos(around)], 1)
    return ball * (0.08, 0.17, 0.1) + (0, -0.05, 0.02)


def flame_vertices(rig: Rig, frame: int) -> np.ndarray:
    """verts: posed, but not moved by the translation; jaw and brows act."""
    head = head_at_rest()
    jaw = (head[:, 1] < -0.02) & (head[:, 2] > 0.04)
    brows = (head[:, 1] > 0.02) & (head[:, 1] < 0.05) & (head[:, 2] > 0.06)
    head[jaw, 1] -= 0.02 * np.sin(frame) ** 2
    head[brows, 1] += 0.01 * np.cos(frame)
    turn = Rotation.from_rotvec(rig.neck()[frame]).as_matrix()
    above = head[:, 1] > NECK[1]
    head[above] = (head[above] - NECK) @ turn.T + NECK
    root = DOWN @ rig.poses()[frame, :3, :3]
    return (head - ROOT) @ root.T + ROOT


def flame(rig: Rig, frame: int) -> dict[str, np.ndarray]:
    """All parts of the fit of a frame."""
    pose = rig.poses()[frame]
    root = DOWN @ pose[:3, :3]
    translation = DOWN @ pose[:3, 3] + root @ ROOT - ROOT
    random = np.random.default_rng(frame)
    return {
        "global_pose": Rotation.from_matrix(root).as_rotvec(),
        "neck_pose": rig.neck()[frame],
        "jaw_pose": random.normal(size=3),
        "left_eye_pose": random.normal(size=3),
        "right_eye_pose": random.normal(size=3),
        "trans": random.normal(size=3),
        "shape": random.normal(size=100),
        "exp": random.normal(size=50),
        "verts": flame_vertices(rig, frame),
        "cam": np.concatenate([[4700.0], translation]),
    }


def face_in_files(rig: Rig, frame: int) -> np.ndarray:
    """(68, 3) landmarks in the world of the files."""
    return faces.moved(rig.world_from_skull()[frame : frame + 1], faces.face())[0] @ DOWN


def landmarks(rig: Rig, camera: int, frame: int) -> np.ndarray:
    """(106, 2) pixels, centres at whole numbers; those that Multi-PIE lacks are anywhere."""
    marks = np.random.default_rng(camera).uniform(5, 20, (106, 2))
    marks[MULTI_PIE] = rig.camera(camera).project(face_in_files(rig, frame))[0]
    return marks


def write_recording(folder: Path, rig: Rig | None = None, same_picture: bool = False) -> Path:
    """Writes both files; gives the raw one.

    With `same_picture` a camera's pictures are all alike, which is faster to write.
    """
    rig = rig or Rig()
    folder.mkdir(parents=True, exist_ok=True)
    raw, annotations = (folder / f"0026_{rig.part}_{kind}.smc" for kind in ("raw", "anno"))
    with h5py.File(raw, "w") as file, h5py.File(annotations, "w") as more:
        for each in (file, more):
            each.attrs.update(actor_id="0026", performance_part=rig.part, gender="female", age=23)
            each.create_group("Camera").attrs.update(
                num_device=len(rig.cameras), num_frame=rig.frames, resolution=rig.size
            )
        for camera in rig.cameras:
            _write_pictures(file, rig, camera, same_picture)
            _write_mattes(more, rig, camera)
            _write_calibration(more, rig, camera)
        _write_fits(more, rig)
        _write_landmarks(more, rig)
        if rig.sound is not None:
            sound = {"raw": file, "anno": more}[rig.sound_in].create_group("Camera/00/audio")
            sound["audio"], sound["sample_rate"] = rig.sound, 48_000
    return raw


def _write_pictures(file: h5py.File, rig: Rig, camera: int, same_picture: bool) -> None:
    data = encoded(picture(camera, 0, rig.size), "JPEG")
    for frame in range(rig.frames):
        if frame and not same_picture:
            data = encoded(picture(camera, frame, rig.size), "JPEG")
        file[f"Camera/{camera:02d}/color/{frame}"] = data


def _write_mattes(file: h5py.File, rig: Rig, camera: int) -> None:
    group = file.create_group(f"Camera/{camera:02d}/mask")
    group["0"] = encoded(matte(rig.size), "PNG")
    for frame in range(1, rig.frames):
        group[str(frame)] = group["0"]  # a hard link


def _write_calibration(file: h5py.File, rig: Rig, camera: int) -> None:
    group = file.create_group(f"Calibration/{camera:02d}")
    group["K"], group["D"] = rig.intrinsics(), np.array(rig.distortion)
    group["RT"] = rig.camera_to_world(camera)


def _write_fits(file: h5py.File, rig: Rig) -> None:
    everywhere = tuple(range(rig.frames)) if rig.part.startswith("e") else ()
    for frame in everywhere if rig.fitted is None else rig.fitted:
        group = file.create_group(f"FLAME/{frame}")
        for name, values in flame(rig, frame).items():
            group[name] = values


def _write_landmarks(file: h5py.File, rig: Rig) -> None:
    for frame in range(rig.frames if rig.seen else 0):
        file[f"Keypoints3d/{frame}"] = np.random.default_rng(frame).normal(size=(73, 3))
        for camera in rig.cameras:
            if camera in FRONTAL:
                file[f"Keypoints2d/{camera:02d}/{frame}"] = landmarks(rig, camera, frame)
