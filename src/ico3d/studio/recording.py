"""Records a synthetic person into a folder that `ico3d.capture.synthetic` reads.

The layout is described in `docs/captures/synthetic.md`, "Synthetic captures".
"""

import io
import json
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from rich.progress import Progress, TextColumn
from safetensors.numpy import save

from ico3d.capture.capture import Sound
from ico3d.capture.decoding import open_picture
from ico3d.capture.synthetic import FORMAT, VERSION
from ico3d.common.camera import Camera
from ico3d.common.files import holds, write_atomic
from ico3d.common.sound import wav_bytes
from ico3d.errors import SettingsError
from ico3d.studio.acting.embody import MOTIONS, embodied
from ico3d.studio.acting.gaze import GAZES, looking
from ico3d.studio.acting.manner import MANNERS, mannered
from ico3d.studio.acting.performance import SOUND_RATE, Performance, perform
from ico3d.studio.choice import load_subject
from ico3d.studio.dress.wearing import GARMENTS, dressed
from ico3d.studio.person.subject import Subject
from ico3d.studio.person.traits.names import TRAITS, TraitName
from ico3d.studio.picture.lamps import STUDIOS
from ico3d.studio.points import surface_points
from ico3d.studio.rigs import BODY_DISTANCE, DISTANCE, RIGS, cameras_of
from ico3d.studio.studio import CLOTHES, Studio, backdrop
from ico3d.studio.webcam.faults import FAULTS, FaultName
from ico3d.studio.webcam.film import write_film

POINTS = 6000
BODY_POINTS = 4000
"""Number of surface points that are written for each frame of a whole person."""
UNFINISHED = "unfinished.json"
"""File that keeps the settings of an unfinished recording."""


@dataclass(frozen=True)
class Recording:
    """Settings of a synthetic recording.

    Attributes:
        subject: `anny` or an `.npz` file.
        rig: Camera rig: `head`, `bust` or `body`.
        cameras: Number of cameras.
        frames: Number of frames.
        fps: Frames per second.
        views_per_frame: Number of cameras that record each frame.
        size: Height of the pictures in pixels; pictures of heads are square.
        text: What is said; if empty, the built-in sentences.
        seed: Seed of all random choices.
        lively: Whether to add expressions and glances that cannot be inferred from the sound.
        light: Lights, one of `STUDIOS`.
        motion: What a whole person does, one of `MOTIONS`.
        garment: Swinging garment that a whole person wears over the clothes, one of `GARMENTS`.
        clothes: What the person wears, one of `CLOTHES`.
        gaze: Where the person looks between glances, one of `GAZES`.
        manner: How the face is all the time, one of `MANNERS`.
        near: How many of the cameras of a whole person show the upper body alone.
        faults: What a webcam in the place of the first camera does wrong, of `FAULTS`; its film is
            written beside the pictures, which stay as they are.
        traits: What the person of a head's recording has, of `TRAITS`.
    """

    subject: str
    rig: str
    cameras: int
    frames: int
    fps: float
    views_per_frame: int
    size: int
    text: str
    seed: int
    lively: bool
    light: str
    motion: str
    garment: str = "none"
    clothes: str = "plain"
    gaze: str = "ahead"
    manner: str = "neutral"
    near: int = 0
    faults: tuple[FaultName, ...] = ()
    traits: tuple[TraitName, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether the whole person is recorded."""
        return self.rig == "body"

    @property
    def arms_clear(self) -> bool:
        """Whether hands keep away from hips and thighs, because the person wears a skirt."""
        return self.garment != "none"


def record(recording: Recording, out: Path, workers: int) -> None:
    """Records a person; a call with the same arguments continues an interrupted recording.

    Args:
        recording: Settings of the recording.
        out: Folder to write; must be empty, or left by an interrupted call.
        workers: Number of threads that draw pictures.

    Raises:
        SettingsError: If the settings contradict each other, or the folder is not empty.
        CaptureError: If the subject cannot be read.
        MissingExtraError: If an optional package is missing.
    """
    _check(recording)
    subject = load_subject(recording.subject, recording.whole, recording.traits)
    acted = perform(
        subject, recording.text, recording.frames, recording.fps, recording.seed, recording.lively
    )
    acted = mannered(subject, acted, recording.manner, recording.seed)
    if recording.whole:
        clear = recording.arms_clear
        acted = embodied(subject, acted, recording.motion, recording.fps, recording.seed, clear)
        subject, acted = dressed(subject, acted, recording.garment, recording.fps)
    if recording.gaze == "visitor":
        ahead = BODY_DISTANCE if recording.whole else DISTANCE
        acted = looking(subject, acted, subject.head_in_world + np.array([0.0, 0.0, ahead]))
    rig = (recording.rig, recording.cameras, recording.size, recording.near)
    cameras = cameras_of(subject, *rig)
    views = choose_views(
        recording.frames, recording.cameras, recording.views_per_frame, recording.seed
    )
    _begin(recording, out)
    lamps = STUDIOS[recording.light]
    backdrops = [backdrop(camera, lamps) for camera in cameras]
    for camera, image in zip(cameras, backdrops, strict=True):
        _write_png(out / "backgrounds" / f"{camera.name}.png", image)
    write_atomic(out / "audio.wav", wav_bytes(acted.samples, SOUND_RATE))
    _write_frames(out / "frames.safetensors", subject, acted, views, recording.seed)
    studio = Studio(subject, lamps, recording.clothes)
    _draw(studio, acted, cameras, backdrops, views, out, workers)
    if recording.faults:
        _film(recording, acted, out / "images" / cameras[0].name, out)
    # Last: a folder with capture.json is complete.
    _write_json(out / "capture.json", recording, subject, acted, cameras)
    (out / UNFINISHED).unlink()


def _check(recording: Recording) -> None:
    choices = {
        "rig": RIGS,
        "light": tuple(STUDIOS),
        "motion": MOTIONS,
        "garment": GARMENTS,
        "clothes": CLOTHES,
        "gaze": GAZES,
        "manner": tuple(MANNERS),
    }
    for name, known in choices.items():
        value = getattr(recording, name)
        if value not in known:
            raise SettingsError(f"there is no {name} '{value}': use {' or '.join(known)}.")
    for name in ("cameras", "frames", "fps", "views_per_frame", "size"):
        if getattr(recording, name) < 1:
            raise SettingsError(f"{name} must be at least 1, not {getattr(recording, name)}.")
    if recording.garment != "none" and not recording.whole:
        raise SettingsError(f"only a whole person wears a {recording.garment}: use --rig body.")
    if recording.garment != "none" and recording.motion == "conversation":
        raise SettingsError("arms hang close in a conversation: they would go through a skirt.")
    if not 0 <= recording.near < recording.cameras:
        raise SettingsError(
            f"near ({recording.near}) must be less than the number of cameras "
            f"({recording.cameras}), and 0 or more."
        )
    if recording.near and not recording.whole:
        raise SettingsError("only cameras of a whole person may stand near: use --rig body.")
    if recording.views_per_frame > recording.cameras:
        raise SettingsError(
            f"views_per_frame ({recording.views_per_frame}) cannot exceed "
            f"the number of cameras ({recording.cameras})."
        )
    if recording.faults:
        _check_faults(recording)
    for name in recording.traits:
        if name not in TRAITS:
            raise SettingsError(f"there is no trait '{name}': use {' or '.join(TRAITS)}.")
    if recording.traits and recording.whole:
        raise SettingsError("traits are those of heads: use --rig head or --rig bust.")


def _check_faults(recording: Recording) -> None:
    for name in recording.faults:
        if name not in FAULTS:
            raise SettingsError(f"there is no fault '{name}': use {' or '.join(FAULTS)}.")
    if recording.views_per_frame < recording.cameras:
        raise SettingsError(
            "a webcam takes every frame: with --faults, use --cameras 1, or --views-per-frame "
            f"{recording.cameras}."
        )
    if recording.size % 2:
        raise SettingsError(f"a film's size must be even, not {recording.size}: change --size.")


def _begin(recording: Recording, out: Path) -> None:
    """Marks a folder as being recorded, unless it is marked with the same settings already."""
    settings = json.dumps(asdict(recording)).encode()
    mark = out / UNFINISHED
    if holds(mark, settings):
        return
    if os.path.exists(out) and (not os.path.isdir(out) or any(out.iterdir())):
        raise SettingsError(f"{out} holds something already: name a new folder.")
    write_atomic(mark, settings)


def choose_views(frames: int, cameras: int, per_frame: int, seed: int) -> np.ndarray:
    """Chooses at random which cameras record each frame, all cameras equally often.

    Returns:
        (frames, cameras) uint8 with `per_frame` ones in each row.
    """
    random = np.random.default_rng([seed, 1])
    views = np.zeros((frames, cameras), np.uint8)
    used = np.zeros(cameras)
    for row in views:
        chosen = np.argsort(used + random.random(cameras))[:per_frame]
        row[chosen] = 1
        used[chosen] += 1
    return views


def _draw(
    studio: Studio,
    acted: Performance,
    cameras: tuple[Camera, ...],
    backdrops: list[np.ndarray],
    views: np.ndarray,
    out: Path,
    workers: int,
) -> None:
    missing = {
        frame: [
            int(c)
            for c in np.flatnonzero(row)
            if not os.path.exists(out / "masks" / cameras[c].name / _png_name(frame))
        ]
        for frame, row in enumerate(views)
    }

    def draw(frame: int) -> None:
        vertices = acted.vertices(studio.subject, frame)
        figure = studio.figure(vertices, acted.world_from_head[frame])
        for index in missing[frame]:
            camera = cameras[index]
            rgb, alpha = studio.picture(camera, figure)
            image = rgb + (1 - alpha[..., None]) * backdrops[index]
            _write_png(out / "images" / camera.name / _png_name(frame), image)
            # The mask comes last: where it is, the picture is whole.
            _write_png(out / "masks" / camera.name / _png_name(frame), alpha)

    jobs = [frame for frame, left in missing.items() if left]
    with ThreadPoolExecutor(workers) as pool:
        try:
            for _ in _progress(pool.map(draw, jobs), len(jobs)):
                pass
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _film(recording: Recording, acted: Performance, pictures: Path, out: Path) -> None:
    """Writes what a webcam in the place of a camera makes of its pictures, and what it did."""

    def load(frame: int) -> np.ndarray:
        file = pictures / _png_name(frame)
        with open_picture(file, str(file)) as picture:
            return np.asarray(picture)

    sound = Sound(acted.samples, SOUND_RATE)
    of = (recording.frames, recording.fps, sound, recording.faults, recording.seed)
    webcam = write_film(out / "webcam.mp4", load, *of)
    write_atomic(out / "webcam.json", webcam.about(recording.fps))


def _png_name(frame: int) -> str:
    return f"{frame:06d}.png"


def _progress(steps: Iterator, total: int) -> Iterator:
    columns = (*Progress.get_default_columns(), TextColumn("{task.completed}/{task.total} frames"))
    with Progress(*columns) as progress:
        yield from progress.track(steps, total=total, description="recording")


def _write_png(path: Path, values: np.ndarray) -> None:
    """Writes display values in [0, 1], (H, W) or (H, W, 3), with 8 bits."""
    data = io.BytesIO()
    Image.fromarray((np.clip(values, 0, 1) * 255 + 0.5).astype(np.uint8)).save(
        data, format="PNG", compress_level=4
    )
    write_atomic(path, data.getvalue())


def _write_frames(
    path: Path, subject: Subject, acted: Performance, views: np.ndarray, seed: int
) -> None:
    meshes = (acted.vertices(subject, frame) for frame in range(len(views)))
    landmarks, points = [], []
    places = surface_points(subject, POINTS if acted.joints is None else BODY_POINTS, seed)
    for mesh, pose in zip(meshes, acted.world_from_head, strict=True):
        landmarks.append(subject.landmarks(mesh))
        if acted.joints is not None:
            points.append(places.on(mesh @ pose[:3, :3].T + pose[:3, 3]))
    arrays = {
        "world_from_head": acted.world_from_head,
        "eyes": acted.eyes,
        "blendshapes": acted.weights,
        "landmarks": np.stack(landmarks).astype(np.float32),
        "views": views,
        "points": np.stack(points) if points else places.on(subject.vertices),
    }
    write_atomic(path, save({k: np.ascontiguousarray(v) for k, v in arrays.items()}))


def _write_json(
    path: Path,
    recording: Recording,
    subject: Subject,
    acted: Performance,
    cameras: tuple[Camera, ...],
) -> None:
    settings = asdict(recording) | {"subject": subject.name, "text": acted.text}
    content = {
        "format": FORMAT,
        "version": VERSION,
        "shows": "body" if recording.whole else "head",
        "fps": recording.fps,
        "num_frames": recording.frames,
        "settings": settings,
        "blendshape_names": subject.blendshape_names,
        "cameras": [
            {
                "name": camera.name,
                "width": camera.width,
                "height": camera.height,
                "intrinsics": camera.intrinsics.tolist(),
                "world_to_camera": camera.world_to_camera.tolist(),
            }
            for camera in cameras
        ],
        "phonemes": [[round(p.time, 6), p.symbol] for p in acted.phonemes],
        "sources": [*subject.sources, "voice: espeak-ng"],
        "licence": subject.licence,
    }
    write_atomic(path, json.dumps(content, indent=1, ensure_ascii=False).encode())
