"""The packaged avatar as a head without landmarks, and recorded as a whole in another studio."""

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
from ico3d.bundle.evaluate import logits
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


def demo() -> BakedAvatar:
    """The packaged avatar."""
    return BakedAvatar.of(Bundle.open(packaged.FILE))


def head_abroad() -> TrainedHead:
    """The demo's head at rest as a head model of its own studio, without landmarks."""
    baked = demo().head
    model = HeadModel(head_shape(baked.expression_size, "static"), baked.num_gaussians)
    rest = logits(baked, np.zeros(baked.expression_size, np.float32))  # (N, 4)
    model.means.data = torch.tensor(baked.means)
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


class FilmedDemo(Capture):
    """Cameras in front of the demo's face; nobody has marked it."""

    kind = "filmed demo"
    fps = 1.0
    num_frames = len(MOMENTS)

    def __init__(self, path: Path, azimuths=AZIMUTHS):
        self.path = path
        self._person = demo()
        self._rest = np.zeros(self._person.head.expression_size, np.float32)
        middle = self.true_world_from_head(0)[:3, 3]
        focal = HEIGHT * AWAY / WIDE
        intrinsics = np.array([[focal, 0, WIDTH / 2], [0, focal, HEIGHT / 2], [0, 0, 1]])
        ways = [(np.sin(a), 0.1, np.cos(a)) for a in np.radians(azimuths)]
        self.cameras = tuple(
            Camera(
                WIDTH, HEIGHT, intrinsics, look_at(middle + AWAY * np.array(way), middle), str(i)
            )
            for i, way in enumerate(ways)
        )
        self.split = all_frames(self.num_frames, self.cameras)

    def true_world_from_head(self, frame: int) -> np.ndarray:
        """(4, 4) rigid, of the demo's head."""
        first = round(MOMENTS[frame] * self._person.fps)
        return self._person.world_from_head[first].astype(np.float64)

    def world_from_head(self, frame: int) -> np.ndarray:
        """What the recording says: in another canonical space."""
        return self.true_world_from_head(frame) @ np.linalg.inv(POSED)

    def image(self, camera: int, frame: int) -> np.ndarray:
        """(H, W, 3) before a wall."""
        person = self._person.gaussians(MOMENTS[frame], self._rest)
        wall = torch.tensor([0.5, 0.6, 0.7])
        return photograph(person, self.cameras[camera], wall)[0].clip(0, 1)


def away(capture: FilmedDemo, folder: Path) -> float:
    """Metres (mean over the Gaussians and frames) from where the head is to where it was put."""
    placement, _ = load_placement(folder / PLACEMENT)
    means = TrainedHead.load(folder / HEAD).model.means.detach().numpy().astype(float)
    apart = []
    for frame in range(capture.num_frames):
        truth = capture.true_world_from_head(frame) @ np.linalg.inv(ABROAD)
        apart += [moved(placement.world_from_head(frame), means) - moved(truth, means)]
    return float(np.linalg.norm(apart, axis=-1).mean())
