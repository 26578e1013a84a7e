r"""Close pictures of synthetic heads for the docs.

    python bench/studio_pictures/faces.py human_face_f.npz human_face_m.npz anny \
        --out docs/images/studio/faces.jpg

A row for each person: from in front, from aside, smiling, and the eyes, which look at the visitor.
`--before` puts an older picture of the first person from in front at the beginning.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from PIL import Image

from ico3d.cli import run_script
from ico3d.common.camera import Camera, look_at
from ico3d.studio.acting.gaze import looking
from ico3d.studio.acting.performance import Performance
from ico3d.studio.choice import load_subject
from ico3d.studio.picture.lamps import STUDIOS
from ico3d.studio.rigs import DISTANCE
from ico3d.studio.studio import Studio, backdrop

QUALITY = 84
SMILE = {"mouthSmile": 0.8, "cheekSquint": 0.4, "mouthUpperUp": 0.3}


@dataclass(frozen=True)
class Shot:
    """Where the camera stands and what the face does.

    Attributes:
        azimuth: Degrees from the front, to the person's left.
        height: Height of the visible field, metres.
        aim: Height of its middle above the eyes, metres.
        smile: Whether the person smiles.
    """

    azimuth: float
    height: float
    aim: float
    smile: bool


SHOTS = (
    Shot(0.0, 0.31, -0.02, False),
    Shot(38.0, 0.31, -0.02, False),
    Shot(-14.0, 0.24, -0.03, True),
    Shot(8.0, 0.12, 0.0, False),
)


@dataclass(frozen=True)
class Bench:
    """What to draw.

    Attributes:
        subjects: Subject files, or `anny`.
        out: Picture to write.
        size: Height of each picture in pixels.
        before: Square picture to show beside the first row.
    """

    subjects: tyro.conf.Positional[tuple[str, ...]]
    out: Path
    size: int = 400
    before: Path | None = None

    def run(self) -> None:
        """Writes the pictures."""
        rows = [np.concatenate([*_faces(s, self.size)], axis=1) for s in self.subjects]
        if self.before is not None:
            older = Image.open(self.before).convert("RGB").resize((self.size, self.size))
            rows[0] = np.concatenate([np.asarray(older), rows[0][:, : -self.size]], axis=1)
        self.out.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.concatenate(rows)).save(self.out, quality=QUALITY)


def _faces(name: str, size: int):
    """(size, size, 3) uint8 pictures of a person, one for each of `SHOTS`."""
    person, lamps = load_subject(name), STUDIOS["studio"]
    studio = Studio(person, lamps)
    place = np.eye(4)
    place[:3, 3] = person.head_in_world
    visitor = person.head_in_world + np.array([0.0, 0.0, DISTANCE])
    for shot in SHOTS:
        smile = {f"{n}{s}": w for n, w in SMILE.items() for s in ("Left", "Right")}
        weights = person.weights(smile if shot.smile else {})
        still = Performance(np.zeros(1), "", (), weights[None], np.zeros((1, 7)), place[None])
        vertices = looking(person, still, visitor).vertices(person, 0)
        aim = person.head_in_world + np.array([0.0, shot.aim, 0.05 * (shot.height < 0.2)])
        turn = np.radians(shot.azimuth)
        eye = aim + DISTANCE * np.array([np.sin(turn), 0.03, np.cos(turn)])
        focal = size * DISTANCE / shot.height
        lens = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]])
        camera = Camera(size, size, lens, look_at(eye, aim), "0")
        rgb, alpha = studio.picture(camera, studio.figure(vertices, place))
        picture = rgb + (1 - alpha[..., None]) * backdrop(camera, lamps)
        yield (picture.clip(0, 1) * 255 + 0.5).astype(np.uint8)


if __name__ == "__main__":
    sys.exit(run_script(Bench))
