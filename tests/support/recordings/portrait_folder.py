"""Writes talking-portrait folders as other tools do, in exactly the documented layout."""

import json
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.io import wavfile
from scipy.spatial.transform import Rotation

SIZE = 64
FOCAL = 150.0
FRAMES = 22


def head_poses(frames: int = FRAMES) -> np.ndarray:
    """(F, 4, 4) OpenGL camera from head: a head that nods, shakes and sways."""
    time = np.arange(frames)
    turns = np.stack([0.2 * np.sin(0.7 * time), 0.3 * np.sin(0.9 * time), 0.1 * time / frames], 1)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("xyz", turns).as_matrix()
    poses[:, :3, 3] = np.stack([0.02 * np.sin(time), 0.01 * np.cos(time), -0.6 + 0 * time], 1)
    return poses


def head_points() -> np.ndarray:
    """(68, 3) fixed points of the head, metres."""
    return np.random.default_rng(0).uniform([-0.07, -0.08, 0.0], [0.07, 0.08, 0.08], (68, 3))


def project(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(K, 2) by the layout's own formula: u = -f X/Z + cx, v = f Y/Z + cy with Z < 0."""
    x, y, z = (points @ pose[:3, :3].T + pose[:3, 3]).T
    return np.stack([-FOCAL * x / z + SIZE / 2, FOCAL * y / z + SIZE / 2], 1)


def write_folder(path: Path, ids: list[int] | None = None, poses: np.ndarray | None = None) -> Path:
    """A folder of `FRAMES` frames; `ids` are what the transforms call them."""
    ids = list(range(FRAMES)) if ids is None else ids
    poses = head_poses() if poses is None else poses
    random = np.random.default_rng(1)
    for folder in ("ori_imgs", "gt_imgs", "parsing", "torso_imgs"):
        (path / folder).mkdir(parents=True)
    parsing = np.full((SIZE, SIZE, 3), 255, np.uint8)
    parsing[8:24, 16:48], parsing[24:40, 16:48], parsing[36:38, 28:36] = 0, (0, 0, 255), 100
    parsing[40:48, 24:40], parsing[48:, 8:56] = (0, 255, 0), (255, 0, 0)
    for frame in range(FRAMES):
        image = random.integers(0, 255, (SIZE, SIZE, 3), np.uint8)
        for folder in ("ori_imgs", "gt_imgs"):
            Image.fromarray(image).save(path / folder / f"{frame}.jpg")
        Image.fromarray(parsing).save(path / "parsing" / f"{frame}.png")
        np.savetxt(path / "ori_imgs" / f"{frame}.lms", project(head_poses()[frame], head_points()))
    Image.fromarray(np.full((SIZE, SIZE, 3), 200, np.uint8)).save(path / "bc.jpg")
    write_transforms(path, ids, poses)
    write_action_units(path, FRAMES)
    tone = np.sin(np.arange(FRAMES * 640) / 10) * 9000
    wavfile.write(path / "aud.wav", 16_000, tone.astype(np.int16))
    return path


def write_transforms(path: Path, ids: list[int], poses: np.ndarray) -> None:
    """Camera to world: the head stands still, the camera moves."""
    first_test = len(ids) * 10 // 11
    for name, part in (("train", slice(0, first_test)), ("val", slice(first_test, None))):
        frames = [
            {"img_id": i, "aud_id": i, "transform_matrix": np.linalg.inv(p).tolist()}
            for i, p in zip(ids[part], poses[part], strict=True)
        ]
        lens = {"focal_len": FOCAL, "cx": SIZE / 2, "cy": SIZE / 2}
        (path / f"transforms_{name}.json").write_text(json.dumps({**lens, "frames": frames}))


def write_action_units(path: Path, rows: int, blink: float = 1.0) -> None:
    """OpenFace's table: a space before every column name but the first."""
    names = ["frame", *(f" AU{n:02}_r" for n in (1, 2, 4, 5, 6, 7, 45))]
    lines = [", ".join(map(str, [i + 1, 2.5, 1.0, 5.0, 0, 0, 0, blink])) for i in range(rows)]
    (path / "au.csv").write_text("\n".join([",".join(names), *lines]) + "\n")
