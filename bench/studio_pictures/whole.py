"""Pictures of a synthetic person for the docs, and the CPU seconds that pictures cost.

    python bench/studio_pictures/whole.py human_face_f.npz --out docs/images/studio/plain.jpg

Head and chest, the whole person, the back, and a raised hand stand side by side. Seconds are of one
thread: `figure` once per frame, `picture` once per camera, at three sizes.
"""

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from PIL import Image

from ico3d.cli import run_script
from ico3d.common.camera import Camera, look_at
from ico3d.studio.acting.acting import pose
from ico3d.studio.acting.gestures import act
from ico3d.studio.choice import load_subject
from ico3d.studio.person.subject import Subject
from ico3d.studio.picture.lamps import STUDIOS
from ico3d.studio.studio import Studio, backdrop

SIZES = (384, 768, 1024)
HEIGHT, QUALITY = 720, 88
"""Height of the strip in pixels, and quality of the JPEG."""
FPS = 15.0


@dataclass(frozen=True)
class Shot:
    """A moment and where the camera stands.

    Attributes:
        motion: What the person does, one of `MOTIONS`.
        frame: Frame of that motion at 15 per second.
        azimuth: Degrees from the front, to the person's left.
        target: Height in metres that the camera looks at; from the eyes if not `whole`.
        field: Height of the visible field there, metres.
        aspect: Width of the picture divided by its height.
        whole: Whether the camera stands back and sees the whole person.
    """

    motion: str
    frame: int
    azimuth: float
    target: float
    field: float
    aspect: float
    whole: bool


SHOTS = (
    Shot("talk", 40, 15.0, -0.12, 0.62, 0.9, False),
    Shot("talk", 40, 20.0, 0.85, 1.95, 0.55, True),
    Shot("talk", 80, 200.0, 0.85, 1.95, 0.55, True),
    Shot("showcase", 65, -30.0, 0.95, 2.15, 0.55, True),
)


@dataclass(frozen=True)
class Bench:
    """What to draw.

    Attributes:
        subject: Subject file (.npz) of a whole person.
        out: Picture to write.
        light: Light of the studio, one of `STUDIOS`.
        clothes: `plain` or `patterned`.
    """

    subject: tyro.conf.Positional[str]
    out: Path
    light: str = "studio"
    clothes: str = "plain"

    def run(self) -> None:
        """Writes the strip and prints the seconds."""
        person, lamps = load_subject(self.subject, whole=True), STUDIOS[self.light]
        studio = Studio(person, lamps, self.clothes)
        strip = []
        for shot in SHOTS:
            vertices, place = _posed(person, shot)
            figure = studio.figure(vertices, place)
            camera = _camera(shot, place, HEIGHT)
            rgb, alpha = studio.picture(camera, figure)
            strip.append(rgb + (1 - alpha[..., None]) * backdrop(camera, lamps))
        self.out.parent.mkdir(parents=True, exist_ok=True)
        pixels = (np.concatenate(strip, axis=1).clip(0, 1) * 255 + 0.5).astype(np.uint8)
        Image.fromarray(pixels).save(self.out, quality=QUALITY)
        vertices, place = _posed(person, SHOTS[0])
        print(f"figure {_seconds(lambda: studio.figure(vertices, place)):.2f} s")
        figure = studio.figure(vertices, place)
        for size in SIZES:
            camera = _camera(SHOTS[0], place, size, 1.0)
            print(f"{size}² {_seconds(lambda c=camera: studio.picture(c, figure)):.2f} s")


def _posed(person: Subject, shot: Shot) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float32 in canonical head space, and the pose (4, 4) of the head."""
    bones = person.skeleton
    assert bones is not None  # the person was loaded whole
    joints = pose(bones, act(bones, shot.motion, np.arange(90) / FPS, 0))[shot.frame]
    joints[:, :3, 3] += person.head_in_world
    place = joints[bones.index("head")]
    return bones.skinned(person.vertices, np.linalg.inv(place) @ joints).astype(np.float32), place


def _camera(shot: Shot, place: np.ndarray, height: int, aspect: float | None = None) -> Camera:
    target = np.array([0.0, shot.target, 0.0])
    if not shot.whole:
        target += place[:3, 3]
    turn, rise, away = np.radians(shot.azimuth), 0.08 * shot.whole, 3.0 if shot.whole else 1.6
    towards = np.array([np.sin(turn), rise, np.cos(turn)])
    width, focal = 2 * round((aspect or shot.aspect) * height / 2), height * away / shot.field
    lens = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(width, height, lens, look_at(target + away * towards, target), "0")


def _seconds(work) -> float:
    """CPU seconds of the quickest of three runs."""
    best = np.inf
    for _ in range(3):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


if __name__ == "__main__":
    sys.exit(run_script(Bench))
