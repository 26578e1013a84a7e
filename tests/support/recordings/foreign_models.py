"""Writes COLMAP models and transforms.json files of a small scene, as those tools do."""

import json
import struct
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

MODELS = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4}
PARAMETERS = {
    "SIMPLE_PINHOLE": (55.0, 20.5, 16.5),
    "PINHOLE": (55.0, 57.0, 20.5, 16.5),
    "SIMPLE_RADIAL": (55.0, 20.5, 16.5, -0.1),
    "RADIAL": (55.0, 20.5, 16.5, -0.1, 0.02),
    "OPENCV": (55.0, 57.0, 20.5, 16.5, -0.1, 0.02, 0.001, -0.002),
}
SIZE = (40, 32)
POINTS = np.random.default_rng(5).normal(0, 0.4, (30, 3)).astype(np.float32)


def poses(count: int = 6) -> np.ndarray:
    """(C, 4, 4) camera to world, OpenCV axes, around the origin of a world with z up."""
    found = np.tile(np.eye(4), (count, 1, 1))
    for index in range(count):
        angle = 2 * np.pi * index / count
        eye = np.array([2 * np.cos(angle), 2 * np.sin(angle), 0.5])
        forward = -eye / np.linalg.norm(eye)
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        found[index, :3, :3] = np.stack([right, np.cross(forward, right), forward], 1)
        found[index, :3, 3] = eye
    return found


def tilted(poses: np.ndarray) -> np.ndarray:
    """The same cameras in a world that lies anyhow."""
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec([0.9, -0.4, 1.1]).as_matrix()
    return turn @ poses


def picture(index: int) -> np.ndarray:
    random = np.random.default_rng(100 + index)
    return random.integers(0, 256, (SIZE[1], SIZE[0], 3), np.uint8)


def write_pictures(folder: Path, names: list[str]) -> None:
    for index, name in enumerate(names):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(picture(index)).save(folder / name)


def colmap_poses(poses: np.ndarray) -> list[tuple[float, ...]]:
    """qw qx qy qz tx ty tz of world to camera."""
    rows = []
    for world_to_camera in np.linalg.inv(poses):
        x, y, z, w = Rotation.from_matrix(world_to_camera[:3, :3]).as_quat()
        rows.append((w, x, y, z, *world_to_camera[:3, 3]))
    return rows


def write_colmap(root: Path, poses: np.ndarray, model: str = "OPENCV", binary: bool = True) -> Path:
    """A folder with images/ and sparse/0."""
    names = [f"view {i}.png" if i else "sub/first.png" for i in range(len(poses))]
    write_pictures(root / "images", names)
    sparse = root / "sparse" / "0"
    sparse.mkdir(parents=True)
    write = _write_binary if binary else _write_text
    write(sparse, colmap_poses(poses), names, model)
    return root


def _write_text(sparse: Path, poses: list, names: list[str], model: str) -> None:
    values = " ".join(map(repr, PARAMETERS[model]))
    lines = ["# Camera list", f"7 {model} {SIZE[0]} {SIZE[1]} {values}"]
    (sparse / "cameras.txt").write_text("\n".join(lines) + "\n")
    lines = ["# Image list with two lines of data per image:"]
    for number, (pose, name) in enumerate(zip(poses, names, strict=True)):
        lines.append(f"{number + 1} {' '.join(map(repr, map(float, pose)))} 7 {name}")
        lines.append("10.5 3.25 -1 7.0 8.0 12" if number % 2 else "")
    (sparse / "images.txt").write_text("\n".join(lines) + "\n")
    rows = [f"{i} {x!r} {y!r} {z!r} 9 8 7 0.5 1 2 3 4" for i, (x, y, z) in _numbered(POINTS)]
    (sparse / "points3D.txt").write_text("# 3D point list\n" + "\n".join(rows) + "\n")


def _numbered(points: np.ndarray):
    return enumerate(map(lambda row: map(float, row), points))


def _write_binary(sparse: Path, poses: list, names: list[str], model: str) -> None:
    values = PARAMETERS[model]
    camera = struct.pack("<QiiQQ", 1, 7, MODELS[model], *SIZE)
    (sparse / "cameras.bin").write_bytes(camera + struct.pack(f"<{len(values)}d", *values))
    data = struct.pack("<Q", len(poses))
    for number, (pose, name) in enumerate(zip(poses, names, strict=True)):
        data += struct.pack("<I7dI", number + 1, *pose, 7) + name.encode() + b"\0"
        data += struct.pack("<Q", number) + struct.pack("<ddq", 1.5, 2.5, -1) * number
    (sparse / "images.bin").write_bytes(data)
    data = struct.pack("<Q", len(POINTS))
    for number, point in enumerate(POINTS):
        data += struct.pack("<Q3d3Bd", number, *point, 9, 8, 7, 0.5)
        data += struct.pack("<QIIII", 2, 1, 2, 3, 4)
    (sparse / "points3D.bin").write_bytes(data)


def frames(poses: np.ndarray, names: list[str], **more) -> list[dict]:
    """Frames of transforms.json: camera to world, OpenGL axes."""
    opengl = poses @ np.diag([1.0, -1, -1, 1])
    return [
        {"file_path": name, "transform_matrix": matrix.tolist(), **more}
        for matrix, name in zip(opengl, names, strict=True)
    ]


def write_transforms(root: Path, frames: list[dict], **more) -> Path:
    lens = {"fl_x": 55.0, "fl_y": 57.0, "cx": 20.5, "cy": 16.5, "w": SIZE[0], "h": SIZE[1]}
    (root / "transforms.json").write_text(json.dumps({**lens, **more, "frames": frames}))
    return root
