"""Recordings of people who do not exist, drawn as Gaussians: no data, no studio, no download."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import soundfile
import torch
from safetensors.torch import save_file

from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.headpose.track_file import HeadTrack
from ico3d.capture.lens import Lens
from ico3d.capture.multiview.description import Description, Place
from ico3d.capture.portrait.files import save_picture
from ico3d.capture.writing.new_folder import new_folder
from ico3d.common.camera import Camera, look_at
from ico3d.common.expression import EYE_NAMES
from ico3d.head.perceptual import CHANNELS, WEIGHTS, vgg_layers
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

FPS, RATE = 25.0, 16_000
HEAD_FRAMES, BODY_FRAMES, BODY_CAMERAS = 22, 9, 6
RADII = (0.075, 0.11, 0.09)
"""Half axes of the head, metres."""
WALL = (0.55, 0.6, 0.65)
"""Colour of the clean plate."""


def write_random_vgg(folder: Path) -> None:
    """Random weights of VGG-16 up to relu3_3, under the names of the public file."""
    torch.manual_seed(0)
    layers = vgg_layers(CHANNELS).state_dict()
    folder.mkdir(parents=True, exist_ok=True)
    save_file({f"features.{name}": value for name, value in layers.items()}, folder / WEIGHTS)


def draw_head(out: Path, size: int, device: torch.device, points: int = 4_000) -> None:
    """A head that turns, whose mouth reddens as it opens: two cameras, sound, a tracked head.

    Args:
        out: Multiview folder to make.
        size: Side of the pictures, pixels.
        device: Where they are drawn.
        points: Number of Gaussians of the head.
    """
    places = _shell(points, RADII)
    opening = 0.5 - 0.5 * np.cos(2.1 * np.arange(HEAD_FRAMES))  # (F,)
    mouth = (places[:, 2] > 0.05) & (np.abs(places[:, 1] + 0.04) < 0.02)
    poses = np.stack([_turned(0.15 * np.sin(0.7 * frame)) for frame in range(HEAD_FRAMES)])

    def person(frame: int) -> Gaussians:
        colors = _colors(places)
        colors[mouth, 0] += 0.4 * opening[frame]
        return _gaussians(places, colors, 0.25 * 0.09 * (2_000 / points) ** 0.5, device)

    eyes = ((-0.12, 0.02, 0.6), (0.2, 0.05, 0.55))
    cameras = _cameras(eyes, (0.0, 0.0, 0.0), 1.7 * size, size)
    with new_folder(out) as work:
        _write_pictures(work, cameras, poses, person)
        _track(places, poses, opening, len(cameras)).write(work)
        (work / "points").mkdir()
        np.save(work / "points" / "000000.npy", places.astype(np.float32))
        times = np.arange(int(HEAD_FRAMES / FPS * RATE)) / RATE
        loud = np.interp(times, np.arange(HEAD_FRAMES) / FPS, opening)
        soundfile.write(work / "audio.wav", 0.4 * loud * np.sin(2 * np.pi * 220 * times), RATE)
        _describe(work, cameras, HEAD_FRAMES, "head")


def draw_body(out: Path, size: int, device: torch.device, points: int = 4_000) -> None:
    """A trunk with an arm that is raised, seen by cameras all around."""
    trunk = _shell(points * 3 // 4, (0.22, 0.8, 0.14)) + np.array([0.0, 0.9, 0.0])
    arm = _shell(points // 4, (0.05, 0.32, 0.05)) - np.array([0.0, 0.32, 0.0])
    shoulder = np.array([0.26, 1.4, 0.0])

    def person(frame: int) -> Gaussians:
        angle = 1.6 * frame / (BODY_FRAMES - 1)
        turn = _turned(-angle, (1, 0))[:3, :3]
        places = np.concatenate([trunk, arm @ turn.T + shoulder])
        colors = _colors(np.concatenate([trunk, arm]))
        return _gaussians(places, colors, 0.02 * (2_000 / points) ** 0.5, device)

    around = 2 * np.pi * np.arange(BODY_CAMERAS) / BODY_CAMERAS
    eyes = [(2.6 * np.sin(a), 1.1, 2.6 * np.cos(a)) for a in around]
    cameras = _cameras(eyes, (0.0, 0.9, 0.0), 1.2 * size, size)
    with new_folder(out) as work:
        _write_pictures(work, cameras, np.tile(np.eye(4), (BODY_FRAMES, 1, 1)), person)
        _describe(work, cameras, BODY_FRAMES, "body")


def _write_pictures(
    work: Path, cameras: list[Camera], poses: np.ndarray, person: Callable[[int], Gaussians]
) -> None:
    """Pictures, masks and clean plates of a person at rigid poses (F, 4, 4)."""
    for camera in cameras:
        behind = torch.tensor(WALL)
        plate = np.broadcast_to(WALL, (camera.height, camera.width, 3))
        save_picture(work / "backgrounds" / f"{camera.name}.png", _bytes(plate))
        for frame, pose in enumerate(poses):
            with torch.no_grad():
                drawn = render(person(frame), [camera.moved(pose)], behind)
            file = f"{camera.name}/{frame:06d}.png"
            save_picture(work / "images" / file, _bytes(drawn.rgb[0].cpu().numpy()))
            save_picture(work / "masks" / file, _bytes(drawn.alpha[0].cpu().numpy()))


def _describe(work: Path, cameras: list[Camera], frames: int, shows: str) -> None:
    places = tuple(
        Place(Lens(c.name, c.width, c.height, c.intrinsics), c.world_to_camera) for c in cameras
    )
    sources, consent = ("drawn Gaussians",), "nobody was recorded"
    Description(FPS, frames, places, sources, consent, "CC0-1.0", shows).write(work)


def _track(places: np.ndarray, poses: np.ndarray, opening: np.ndarray, cameras: int) -> HeadTrack:
    """The head as a tracker finds it: 68 places of the face stand for the landmarks."""
    front = places[places[:, 2] > 0.04]
    face = front[np.random.default_rng(0).choice(len(front), 68)]
    shapes = np.zeros((len(poses), len(BLENDSHAPES)), np.float32)
    shapes[:, BLENDSHAPES.index("jawOpen")] = opening
    eyes = np.zeros((len(poses), len(EYE_NAMES)), np.float32)
    views = np.ones((len(poses), cameras), np.uint8)
    landmarks = np.tile(face.astype(np.float32), (len(poses), 1, 1))
    return HeadTrack(poses, landmarks, eyes, shapes, views)


def _cameras(eyes, target, focal: float, size: int) -> list[Camera]:
    lens = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]])
    return [
        Camera(size, size, lens, look_at(np.array(eye), np.array(target)), f"cam{number:02d}")
        for number, eye in enumerate(eyes)
    ]


def _shell(count: int, radii: tuple[float, float, float]) -> np.ndarray:
    """(N, 3) random places on an ellipsoid, metres."""
    directions = np.random.default_rng(0).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True) * radii


def _colors(places: np.ndarray) -> np.ndarray:
    """(N, 3) a pattern of stripes that tells places apart."""
    return 0.4 + 0.2 * np.sin(60 * places + np.arange(3))


def _gaussians(places: np.ndarray, colors: np.ndarray, scale: float, device) -> Gaussians:
    count = len(places)
    values = (
        places,
        np.tile([1.0, 0, 0, 0], (count, 1)),
        np.full((count, 3), scale),
        np.full(count, 0.95),
        colors.clip(0, 1),
    )
    return Gaussians(*(torch.from_numpy(v).float().to(device) for v in values))


def _turned(angle: float, axes: tuple[int, int] = (2, 0)) -> np.ndarray:
    """(4, 4) rotation by an angle that takes the first axis towards the second."""
    turn, (one, other) = np.eye(4), axes
    turn[one, one] = turn[other, other] = np.cos(angle)
    turn[other, one], turn[one, other] = np.sin(angle), -np.sin(angle)
    return turn


def _bytes(picture: np.ndarray) -> np.ndarray:
    return (picture.clip(0, 1) * 255 + 0.5).astype(np.uint8)
