"""The packaged avatar as a head without landmarks, and recorded as a whole in another studio."""

from functools import cache
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from ico3d.avatar.avatar import HEAD, PLACEMENT, load_placement
from ico3d.avatar.joining.assemble import Assembly
from ico3d.avatar.joining.settings import JoiningSettings
from ico3d.avatar.joining.similarity import moved
from ico3d.avatar.render_bundle import BakedAvatar
from ico3d.body.settings import settings_for
from ico3d.bundle import packaged
from ico3d.bundle.evaluate import centres, logits
from ico3d.bundle.format import Bundle
from ico3d.capture.capture import Capture, all_frames
from ico3d.common.camera import Camera, look_at
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from support.heads.shapes import head_shape
from support.photograph import photograph

MOMENTS = (0.0, 1.5, 3.0)
"""Seconds of the demo's motion."""
WIDTH, HEIGHT, WIDE, AWAY = 300, 300, 0.6, 1.6
"""Of the pictures in pixels, and metres that they show and are taken from."""
AZIMUTHS = (-50, -25, 0, 25, 50)
ABROAD = np.eye(4)
"""The head's own studio from the space of the demo's head: another way up, unit and place."""
ABROAD[:3, :3] = 7.3 * Rotation.from_euler("xyz", (-70, 130, 20), degrees=True).as_matrix()
ABROAD[:3, 3] = 5, -3, 9
POSED = np.eye(4)
"""The space of the recording's head poses from that of the demo's."""
POSED[:3, :3] = Rotation.from_euler("xyz", (10, -20, 5), degrees=True).as_matrix()
POSED[:3, 3] = 0.01, 0.03, -0.02


@cache
def demo() -> BakedAvatar:
    """The packaged avatar, read once in a process."""
    return BakedAvatar.of(Bundle.open(packaged.FILE))


def head_abroad() -> TrainedHead:
    """The demo's head at rest as a head model of its own studio, without landmarks."""
    baked = demo().head
    model = HeadModel(head_shape(baked.expression_size, "static"), baked.num_gaussians)
    silent = np.zeros(baked.expression_size, np.float32)
    rest = logits(baked, silent)  # (N, 4)
    model.means.data = torch.from_numpy(centres(baked, silent))
    model.quats.data = torch.tensor(baked.quats.astype(np.float32))
    model.log_scales.data = torch.tensor(baked.scales.astype(np.float32))
    model.basis.data = torch.from_numpy(rest)[None].clone()  # (1, N, 4)
    there = model(torch.zeros(baked.expression_size)).transform(ABROAD)
    model.means.data, model.quats.data = there.means.detach(), there.quats.detach()
    model.log_scales.data = there.scales.detach().log()
    names = tuple(f"e{i}" for i in range(baked.expression_size))
    return TrainedHead(model.requires_grad_(False), "blendshapes", names, "", "", None, {})


def saved(head: TrainedHead, folder: Path) -> Assembly:
    """What to assemble of a head, whose folder this writes."""
    folder.mkdir()
    head.save(folder)
    plain = JoiningSettings(match_colors=False)
    return Assembly(folder, plain, settings_for("cpu", "swings++"), 0)


def _head_at(frame: int) -> np.ndarray:
    """(4, 4) rigid, from the space of the demo's head to the world."""
    first = round(MOMENTS[frame] * demo().fps)
    return demo().world_from_head[first].astype(np.float64)


def _camera(azimuth: float, name: str) -> Camera:
    """One that looks at the head, from so many degrees at its side."""
    middle, focal = _head_at(0)[:3, 3], HEIGHT * AWAY / WIDE
    intrinsics = np.array([[focal, 0, WIDTH / 2], [0, focal, HEIGHT / 2], [0, 0, 1]])
    way = np.array([np.sin(np.radians(azimuth)), 0.1, np.cos(np.radians(azimuth))])
    return Camera(WIDTH, HEIGHT, intrinsics, look_at(middle + AWAY * way, middle), name)


@cache
def _taken(azimuth: float, frame: int) -> np.ndarray:
    """(H, W, 3) what a camera sees before a wall."""
    rest = np.zeros(demo().head.expression_size, np.float32)
    person, wall = demo().gaussians(MOMENTS[frame], rest), torch.tensor([0.5, 0.6, 0.7])
    return photograph(person, _camera(azimuth, ""), wall)[0].clip(0, 1)


class FilmedDemo(Capture):
    """Cameras in front of the demo's face; nobody has marked it."""

    kind = "filmed demo"
    fps = 1.0
    num_frames = len(MOMENTS)

    def __init__(self, path: Path, azimuths=AZIMUTHS):
        self.path = path
        self._azimuths = azimuths
        self.cameras = tuple(_camera(azimuth, str(i)) for i, azimuth in enumerate(azimuths))
        self.split = all_frames(self.num_frames, self.cameras)

    def true_world_from_head(self, frame: int) -> np.ndarray:
        """(4, 4) rigid, of the demo's head."""
        return _head_at(frame)

    def world_from_head(self, frame: int) -> np.ndarray:
        """What the recording says: in another canonical space."""
        return self.true_world_from_head(frame) @ np.linalg.inv(POSED)

    def image(self, camera: int, frame: int) -> np.ndarray:
        """(H, W, 3) before a wall."""
        return _taken(self._azimuths[camera], frame).copy()


def away(capture: FilmedDemo, folder: Path) -> float:
    """Metres (mean over the Gaussians and frames) from where the head is to where it was put."""
    placement, _ = load_placement(folder / PLACEMENT)
    means = TrainedHead.load(folder / HEAD).model.means.detach().numpy().astype(float)
    apart = []
    for frame in range(capture.num_frames):
        truth = capture.true_world_from_head(frame) @ np.linalg.inv(ABROAD)
        apart += [moved(placement.world_from_head(frame), means) - moved(truth, means)]
    return float(np.linalg.norm(apart, axis=-1).mean())
