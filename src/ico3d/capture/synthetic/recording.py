"""Records a synthetic person: writes the folder that `reader` reads.

Layout: `docs/captures-synthetic.md`, "Synthetic captures".
"""

import io
import json
import wave
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from rich.progress import Progress, TextColumn
from safetensors.numpy import save

from ico3d.capture.synthetic.performance import SOUND_RATE, Performance, perform
from ico3d.capture.synthetic.points import surface_points
from ico3d.capture.synthetic.reader import FORMAT, VERSION
from ico3d.capture.synthetic.studio import RIGS, Studio, backdrop, camera_arc
from ico3d.capture.synthetic.subject import Subject
from ico3d.capture.synthetic.subjects import load_subject
from ico3d.common.camera import Camera
from ico3d.common.files import write_atomic
from ico3d.errors import SettingsError

FPS = 25.0
POINTS = 6000
UNFINISHED = "unfinished.json"
"""Settings of a recording that has not come to its end."""


@dataclass(frozen=True)
class Recording:
    """What to record.

    Attributes:
        subject: `anny` or an `.npz` file.
        rig: Name of the camera rig: `head` or `bust`.
        cameras: How many cameras.
        frames: How many frames at 25 per second.
        views_per_frame: How many cameras take a picture of each frame.
        size: Width and height of the pictures.
        text: What is said; empty for sentences of our own.
        seed: Decides everything that is random.
        lively: Whether the face shows moods and glances too, which the sound does not tell.
    """

    subject: str
    rig: str
    cameras: int
    frames: int
    views_per_frame: int
    size: int
    text: str
    seed: int
    lively: bool


def record(recording: Recording, out: Path, workers: int) -> None:
    """Records a person; the same call goes on where an earlier one was cut off.

    Args:
        recording: What to record.
        out: Folder to write; holds nothing yet, or what a cut-off call left.
        workers: Threads that draw pictures.

    Raises:
        SettingsError: If the settings make no sense or the folder is not empty.
        CaptureError: If the subject cannot be read.
        MissingExtraError: If an optional package is missing.
    """
    _check(recording)
    subject = load_subject(recording.subject)
    acted = perform(
        subject, recording.text, recording.frames, FPS, recording.seed, recording.lively
    )
    cameras = camera_arc(subject, recording.rig, recording.cameras, recording.size)
    views = choose_views(
        recording.frames, recording.cameras, recording.views_per_frame, recording.seed
    )
    _begin(recording, out)
    backdrops = [backdrop(camera) for camera in cameras]
    for camera, image in zip(cameras, backdrops, strict=True):
        _write_png(out / "backgrounds" / f"{camera.name}.png", image)
    _write_sound(out / "audio.wav", acted.samples)
    _write_frames(out / "frames.safetensors", subject, acted, views, recording.seed)
    _draw(subject, acted, cameras, backdrops, views, out, workers)
    # Last: a folder with capture.json is complete.
    _write_json(out / "capture.json", recording, subject, acted, cameras)
    (out / UNFINISHED).unlink()


def _check(recording: Recording) -> None:
    if recording.rig not in RIGS:
        raise SettingsError(f"there is no rig '{recording.rig}': use {' or '.join(RIGS)}.")
    for name in ("cameras", "frames", "views_per_frame", "size"):
        if getattr(recording, name) < 1:
            raise SettingsError(f"{name} must be at least 1, not {getattr(recording, name)}.")
    if recording.views_per_frame > recording.cameras:
        raise SettingsError(
            f"views_per_frame ({recording.views_per_frame}) cannot exceed "
            f"the number of cameras ({recording.cameras})."
        )


def _begin(recording: Recording, out: Path) -> None:
    """Marks a folder as being recorded, unless it is marked with the same settings already."""
    settings = json.dumps(asdict(recording)).encode()
    mark = out / UNFINISHED
    if mark.is_file() and mark.read_bytes() == settings:
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise SettingsError(f"{out} holds something already: name a new folder.")
    write_atomic(mark, settings)


def choose_views(frames: int, cameras: int, per_frame: int, seed: int) -> np.ndarray:
    """Which cameras take each frame, each as often as the others, in random order.

    Returns:
        (frames, cameras) uint8, `per_frame` ones in each row.
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
    subject: Subject,
    acted: Performance,
    cameras: tuple[Camera, ...],
    backdrops: list[np.ndarray],
    views: np.ndarray,
    out: Path,
    workers: int,
) -> None:
    studio = Studio(subject)

    def draw(job: tuple[int, int]) -> None:
        frame, index = job
        camera = cameras[index]
        rgb, alpha = studio.picture(camera, acted.weights[frame], acted.world_from_head[frame])
        image = rgb + (1 - alpha[..., None]) * backdrops[index]
        _write_png(out / "images" / camera.name / _png_name(frame), image)
        # The mask comes last: where it is, the picture is whole.
        _write_png(out / "masks" / camera.name / _png_name(frame), alpha)

    jobs = [(int(f), int(c)) for f, c in np.argwhere(views)]
    jobs = [j for j in jobs if not (out / "masks" / cameras[j[1]].name / _png_name(j[0])).exists()]
    with ThreadPoolExecutor(workers) as pool:
        try:
            for _ in _progress(pool.map(draw, jobs), len(jobs)):
                pass
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _png_name(frame: int) -> str:
    return f"{frame:06d}.png"


def _progress(steps: Iterator, total: int) -> Iterator:
    columns = (*Progress.get_default_columns(), TextColumn("{task.completed}/{task.total} images"))
    with Progress(*columns) as progress:
        yield from progress.track(steps, total=total, description="recording")


def _write_png(path: Path, values: np.ndarray) -> None:
    """Writes display values in [0, 1], (H, W) or (H, W, 3), with 8 bits."""
    data = io.BytesIO()
    Image.fromarray((np.clip(values, 0, 1) * 255 + 0.5).astype(np.uint8)).save(
        data, format="PNG", compress_level=4
    )
    write_atomic(path, data.getvalue())


def _write_sound(path: Path, samples: np.ndarray) -> None:
    data = io.BytesIO()
    with wave.open(data, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(SOUND_RATE)
        file.writeframes((np.clip(samples, -1, 1) * 32767).astype("<i2").tobytes())
    write_atomic(path, data.getvalue())


def _write_frames(
    path: Path, subject: Subject, acted: Performance, views: np.ndarray, seed: int
) -> None:
    landmarks = [subject.landmarks(subject.posed(w)) for w in acted.weights]
    arrays = {
        "world_from_head": acted.world_from_head,
        "eyes": acted.eyes,
        "blendshapes": acted.weights,
        "landmarks": np.stack(landmarks).astype(np.float32),
        "views": views,
        "points": surface_points(subject, POINTS, seed),
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
        "fps": FPS,
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
