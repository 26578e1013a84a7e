"""Tiny recordings of one synthetic person, laid out as each guide expects them."""

import json
import shutil
from pathlib import Path

import numpy as np
from PIL import Image

from ico3d.avatar.film.video import write_video
from ico3d.capture.capture import Capture
from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.formats import open_capture
from ico3d.capture.headpose.track_file import HeadTrack
from ico3d.capture.importing.resizing import resize_capture
from ico3d.common.expression import EYE_NAMES
from ico3d.studio.layouts import smc
from ico3d.studio.picture import paint
from ico3d.studio.recording import Recording, record

SIZE, CAMERAS, FRAMES, FPS = 144, 3, 4, 15.0
WARM = np.array([1.0, 0.85, 0.65])
PHONE_FPS, PHONE_ROUNDS = 25.0, 3


def person(folder: Path) -> Path:
    """Somebody who talks, head and shoulders, by a few cameras at once."""
    about = Recording(
        "anny", "bust", CAMERAS, FRAMES, FPS, CAMERAS, SIZE, "", 1, False, "studio", "talk"
    )
    directions, paint.DIRECTIONS = paint.DIRECTIONS, 6  # light from few directions: drawn sooner
    try:
        record(about, folder, 2)
    finally:
        paint.DIRECTIONS = directions
    return folder


def in_warm_light(recorded: Path, folder: Path) -> Path:
    """The same recording under another lamp."""
    shutil.copytree(recorded, folder)
    for file in [*folder.glob("images/*/*.png"), *folder.glob("backgrounds/*.png")]:
        pixels = np.asarray(Image.open(file).convert("RGB")) * WARM
        Image.fromarray((pixels + 0.5).astype(np.uint8)).save(file)
    return folder


def many_cameras(face: Path, body: Path, work: Path) -> None:
    """What somebody with cameras of their own has: pictures, plates, calibration, sound."""
    for name, recorded, shows in (("face", face, "head"), ("body", body, "body")):
        folder = work / "captures" / name
        resize_capture(recorded, folder, SIZE, 2)
        shutil.rmtree(folder / "masks")
        about = json.loads((folder / "cameras.json").read_text())
        told = {"shows": shows, "likeness": "Anna", "consent": "written", "licence": "ours"}
        (folder / "cameras.json").write_text(json.dumps(about | told))
    shutil.copy(face / "audio.wav", work / "speech.wav")


def data_sets(face: Path, body: Path, work: Path) -> None:
    """What the makers of the data sets hand out."""
    smc.write_renderme(open_capture(face), work / "renderme", "0026_s1_all")
    smc.write_dna(open_capture(body), work / "dna", "0012_11")
    shutil.copy(face / "audio.wav", work / "speech.wav")


def phone(face: Path, work: Path) -> None:
    """A video by one camera: the frames there and back, so that it is long enough."""
    capture = open_capture(face)
    order = [*range(FRAMES), *range(FRAMES - 2, 0, -1)] * PHONE_ROUNDS
    pictures = ((capture.image(0, frame) * 255).astype(np.uint8) for frame in order)
    write_video(work / "me.mp4", pictures, (SIZE, SIZE), PHONE_FPS, capture.audio())
    shutil.copy(face / "audio.wav", work / "speech.wav")


def write_known_track(truth: Capture, folder: Path) -> None:
    """What `ico3d capture track` would find, from what is known about the head.

    Args:
        truth: The studio's recording.
        folder: The same recording in another format; its world may be turned.
    """
    first = open_capture(folder).cameras[0]
    turn = first.camera_to_world @ truth.cameras[0].world_to_camera
    frames = range(truth.num_frames)
    eyes = [truth.eyes(frame) for frame in frames]
    closed = np.zeros(len(EYE_NAMES))
    HeadTrack(
        np.stack([turn @ truth.world_from_head(frame) for frame in frames]),
        np.stack([truth.landmarks_3d(frame) for frame in frames]).astype(np.float32),
        np.stack([closed if row is None else row for row in eyes]).astype(np.float32),
        np.zeros((len(frames), len(BLENDSHAPES)), np.float32),
        np.ones((len(frames), len(truth.cameras)), np.uint8),
    ).write(folder)
