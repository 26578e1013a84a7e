"""Writes DNA-Rendering recordings: SMC files in the documented layout, with small pictures."""

import io
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from PIL import Image

from ico3d.common.camera import look_at

FIRST_12MP = 48
IDENTITY = np.tile([0.0, 1.0, 0.0], (3, 1))


@dataclass(frozen=True)
class Rig:
    """What is written.

    Attributes:
        cameras: Their numbers; those from 48 on are of the 12 megapixel kind.
        frames: How many.
        sizes: (height, width) of the 5 and of the 12 megapixel pictures.
        distortion: k1, k2, p1, p2, k3 of all cameras.
        colours: (3, 3) polynomials, rows blue, green, red.
        up: Which way is up in the world of the files.
        annotated: With masks, keypoints and SMPL-X, as parts 1 and 2 have them.
        expression_rows, betas_rows: Rows of these; all frames by default.
        keypoints: (T, J, 3) in space; a few at random by default.
    """

    cameras: tuple[int, ...] = (0, 1, 2, 3, 47, 48, 59)
    frames: int = 3
    sizes: tuple[tuple[int, int], tuple[int, int]] = ((48, 40), (64, 56))
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    colours: np.ndarray | None = None
    up: tuple[float, float, float] = (0.0, -1.0, 0.0)
    annotated: bool = True
    expression_rows: int | None = None
    betas_rows: int | None = None
    keypoints: np.ndarray | None = None

    def size(self, camera: int) -> tuple[int, int]:
        return self.sizes[camera >= FIRST_12MP]

    def intrinsics(self, camera: int) -> np.ndarray:
        """K as OpenCV calibrates it."""
        height, width = self.size(camera)
        focal = 2.0 * height + camera
        return np.array([[focal, 0, width / 2 - 1.0], [0, focal + 3, height / 2 + 1.5], [0, 0, 1]])

    def camera_to_world(self, camera: int) -> np.ndarray:
        """RT: a ring of 3 m around a person at the origin."""
        angle = 2 * np.pi * camera / 60
        up = np.array(self.up)
        side = np.roll(np.abs(up), 1)
        eye = 3 * (np.cos(angle) * side + np.sin(angle) * np.cross(up, side)) + 0.2 * up
        return np.linalg.inv(look_at(eye, (0, 0, 0), up))


def picture(camera: int, frame: int, size: tuple[int, int]) -> np.ndarray:
    """A smooth uint8 RGB picture that differs between cameras and frames."""
    y, x = np.mgrid[: size[0], : size[1]] / max(size)
    waves = [np.sin(9 * x + camera), np.cos(7 * y + frame), np.sin(5 * (x + y) + camera + frame)]
    return np.stack([120 + 100 * w for w in waves], -1).astype(np.uint8)


def mask(camera: int, size: tuple[int, int]) -> np.ndarray:
    """uint8 (H, W, 3): an upright box, only its red channel full."""
    values = np.zeros((*size, 3), np.uint8)
    values[size[0] // 4 : -size[0] // 8, size[1] // 3 : -size[1] // 3] = (255, 130, 60)
    return values


def encoded(image: np.ndarray, kind: str) -> np.ndarray:
    """1-D uint8."""
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, kind, **({"quality": 95} if kind == "JPEG" else {}))
    return np.frombuffer(stream.getvalue(), np.uint8)


def smplx(frames: int) -> dict[str, np.ndarray]:
    random = np.random.default_rng(7)
    shapes = {"betas": (10,), "expression": (10,), "fullpose": (55, 3), "transl": (3,)}
    return {name: random.normal(size=(frames, *shape)) for name, shape in shapes.items()}


def keypoints_3d(frames: int) -> np.ndarray:
    return np.random.default_rng(8).uniform(-0.8, 0.8, (frames, 5, 3))


def keypoints_2d(rig: Rig, camera: int) -> np.ndarray:
    height, width = rig.size(camera)
    random = np.random.default_rng(camera)
    return random.uniform(0.3, 0.7, (rig.frames, 5, 3)) * (width, height, 1)


def write_recording(
    folder: Path, rig: Rig | None = None, name: str = "0012_11", same_picture: bool = False
) -> Path:
    """Writes the main file and the annotations; gives the main file.

    With `same_picture` a camera's pictures are all alike, which is faster to write.
    """
    rig = rig or Rig()
    folder.mkdir(parents=True, exist_ok=True)
    main = folder / f"{name}.smc"
    with h5py.File(main, "w") as file:
        file.attrs.update(
            actor_id=12, performance_id=11, age=30, gender="female", height=170.0, weight=60.0
        )
        for group, numbers in groups(rig).items():
            made = file.create_group(group)
            size = rig.sizes[group == "Camera_12mp"]
            made.attrs.update(num_device=len(numbers), num_frame=rig.frames, resolution=size)
            for camera in numbers:
                data = encoded(picture(camera, 0, rig.size(camera)), "JPEG")
                pictures = made.create_group(f"{camera}/color")
                for frame in range(rig.frames):
                    if frame and not same_picture:
                        data = encoded(picture(camera, frame, rig.size(camera)), "JPEG")
                    write_bytes(pictures, frame, data)
    with h5py.File(folder / f"{name}_annots.smc", "w") as file:
        for camera in rig.cameras:
            write_calibration(file.create_group(f"Camera_Parameter/{camera:02d}"), rig, camera)
        if rig.annotated:
            write_annotations(file, rig)
    return main


def write_bytes(group: h5py.Group, number: int, data: np.ndarray) -> None:
    """Writes 1-D uint8 as a data set of that number; `create_dataset` takes four times as long."""
    space, kind = h5py.h5s.create_simple(data.shape), h5py.h5t.NATIVE_UINT8
    h5py.h5d.create(group.id, str(number).encode(), kind, space).write(space, space, data)


def groups(rig: Rig) -> dict[str, list[int]]:
    small = [c for c in rig.cameras if c < FIRST_12MP]
    large = [c for c in rig.cameras if c >= FIRST_12MP]
    return {name: n for name, n in (("Camera_5mp", small), ("Camera_12mp", large)) if n}


def write_calibration(group: h5py.Group, rig: Rig, camera: int) -> None:
    group["K"] = rig.intrinsics(camera)
    group["D"] = np.array(rig.distortion)
    group["RT"] = rig.camera_to_world(camera)
    group["Color_Calibration"] = IDENTITY if rig.colours is None else rig.colours


def write_annotations(file: h5py.File, rig: Rig) -> None:
    for camera in rig.cameras:
        data = encoded(mask(camera, rig.size(camera)), "PNG")
        masks = file.create_group(f"Mask/{camera}/mask")
        masks.create_dataset("0", data=data)
        for frame in range(1, rig.frames):  # the person stands still
            masks.id.links.create_hard(str(frame).encode(), masks.id, b"0")
        file[f"Keypoints_2D/{camera:02d}"] = keypoints_2d(rig, camera)
    points = keypoints_3d(rig.frames) if rig.keypoints is None else rig.keypoints
    file["Keypoints_3D/keypoints3d"] = points
    parts = smplx(rig.frames)
    parts["expression"] = parts["expression"][: rig.expression_rows]
    parts["betas"] = parts["betas"][: rig.betas_rows]
    for name, values in parts.items():
        file[f"SMPLx/{name}"] = values
    file["SMPLx/scale"] = np.float64(1.02)


def write_kinect(main: Path, rig: Rig) -> Path:
    """Writes the depth file of a recording: two cameras."""
    path = main.with_name(f"{main.stem}_kinect.smc")
    with h5py.File(path, "w") as file:
        for camera in (0, 7):
            group = file.create_group(f"Calibration/Kinect/{camera:02d}")
            group["K"], group["D"] = rig.intrinsics(0), np.zeros(8)
            group["RT"] = rig.camera_to_world(8 * camera)
            for frame in range(rig.frames):
                file[f"Kinect/{camera}/depth/{frame}"] = depth(camera, frame)
                data = encoded(mask(camera, (12, 10)), "PNG")
                file.create_dataset(f"Kinect/{camera}/mask/{frame}", data=data)
    return path


def depth(camera: int, frame: int) -> np.ndarray:
    return np.random.default_rng((camera, frame)).integers(0, 5000, (12, 10)).astype(np.uint16)
