"""A small head on a small body, placed by a similarity, and recordings of both."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import torch

from ico3d.avatar.avatar import BODY, Placement, TrainedAvatar
from ico3d.avatar.baking.samples import expressions_at
from ico3d.body.model_folder import TrainedBody, save_window
from ico3d.body.motion.formulas import SPACETIME
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.common.expression import EyeRange
from ico3d.head.model_folder import TrainedHead
from ico3d.speech.encoder import load_encoder
from ico3d.speech.network import SpeechAdaptor
from support.avatars.filmed_person import FilmedPerson
from support.avatars.origins import origin
from support.avatars.planted import PlantedCapture, planted_eyes, planted_model

FPS, WINDOWS = 15.0, (Window(0, 8), Window(8, 14))
FRAMES = WINDOWS[-1].last + 1
NECK = np.array([0.0, 1.55, 0.0])


def write_whole_person(folder: Path) -> TrainedAvatar:
    """An avatar's folder, as `ico3d assemble` leaves it."""
    body, head = _body(folder / BODY), _head(planted_eyes(head_recording(folder)))
    recording = head_recording(folder)
    shown = recording.split.train[10 : 10 + FRAMES]
    expressions = expressions_at(head.track(recording), shown)
    avatar = TrainedAvatar(head, body, _placement(), expressions, {})
    avatar.save(folder)
    return TrainedAvatar.load(folder)


class WholeFilmed(FilmedPerson):
    """Five cameras around the whole person."""

    def __init__(self, avatar: TrainedAvatar, path: Path):
        person = SimpleNamespace(windows=avatar.body.windows, gaussians=avatar.gaussians)
        super().__init__(person, path)


def head_recording(path: Path) -> PlantedCapture:
    """It has sound and eyes, which is what drives a head."""
    return PlantedCapture(path)


def _head(eyes: EyeRange) -> TrainedHead:
    encoder = load_encoder("builtin")
    torch.manual_seed(0)
    adaptor = SpeechAdaptor(encoder.size).requires_grad_(False)
    about = origin("planted")
    args = ("speech", (), "builtin", encoder.sha256, adaptor, {"capture": about})
    return TrainedHead(planted_model(39), *args, eyes=eyes)


def _body(folder: Path) -> TrainedBody:
    """A trunk of Gaussians that turns and swings a little; the windows agree where they meet."""
    generator = torch.Generator().manual_seed(1)
    sizes = {"means": (3,), "quats": (4,), "path": (3, 3), "turn": (4,), "color_logits": (3,)}
    values = {n: torch.randn(200, *s, generator=generator) for n, s in sizes.items()}
    values["means"] = values["means"] * torch.tensor([0.15, 0.25, 0.08]) + torch.tensor([0, 1.0, 0])
    values["path"] = values["path"] * 0.02
    values["turn"] = values["turn"] * 0.1
    values["quats"][:, 0] += 2
    values["log_scales"] = torch.full((200, 3), -3.2)
    values["opacity_logits"] = torch.full((200,), 2.0)
    values["center"] = torch.full((200,), 0.5)
    values["log_duration"] = torch.full((200,), 8.0)
    models = [WindowModel(SPACETIME, dict(values), {}) for _ in WINDOWS]
    files = [f"{i}.safetensors" for i in range(len(WINDOWS))]
    for file, model in zip(files, models, strict=True):
        save_window(folder / file, model)
    about = origin("filmed", "CC-BY-4.0")
    body = TrainedBody(models, WINDOWS, FPS, "spacetime", {"capture": about})
    body.save(folder, files)
    return body


def _placement() -> Placement:
    """G grows the head by a tenth and turns it; W_i nods on the neck."""
    similarity = np.eye(4)
    similarity[:3, :3] = 1.1 * _turn(0.3, 1)
    similarity[:3, 3] = (0.01, 0.1, -0.02)
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    for frame, pose in enumerate(poses):
        pose[:3, :3] = _turn(0.2 * np.sin(0.5 * frame), 0)
        pose[:3, 3] = NECK + np.array([0.03 * np.sin(0.3 * frame), 0, 0])
    return Placement(similarity, poses)


def _turn(angle: float, axis: int) -> np.ndarray:
    a, b = [i for i in range(3) if i != axis]
    turn = np.eye(3)
    turn[a, a] = turn[b, b] = np.cos(angle)
    turn[a, b], turn[b, a] = -np.sin(angle), np.sin(angle)
    return turn
