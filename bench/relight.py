"""How well a head that was recorded in one light is put into that of a body's recording.

    python bench/relight.py human_face_f.npz --work WORK [--picture joining.jpg]

One person is recorded three times: head and shoulders in neutral light, which teaches the head; the
whole body in warm light from the other side, in which faces are small; and the first performance
again in warm light, by the same cameras, which is the truth and teaches nothing. The picture shows
test frames: the head in its own light | relit | the truth. What WORK holds already is not made
again.
"""

import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import tyro
from PIL import Image
from scipy.ndimage import binary_erosion, gaussian_filter

from ico3d.avatar.joining.assemble import align
from ico3d.avatar.joining.cropping import cropped
from ico3d.avatar.joining.driving import recorded_expressions
from ico3d.avatar.joining.face_views import face_views
from ico3d.avatar.joining.relight import relit
from ico3d.capture.capture import Capture
from ico3d.capture.face.region import HeadRegion
from ico3d.capture.formats import open_capture
from ico3d.cli import run_script
from ico3d.common.camera import Camera
from ico3d.common.psnr import decibels
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.render import render

BUST = "--rig bust --cameras 8 --frames 110 --fps 8 --size 208"
SHOTS = {
    "head": f"{BUST} --light studio",
    "body": "--rig body --light warm --cameras 12 --frames 6 --fps 2 --size 480",
    "truth": f"{BUST} --light warm",
}
TRAINING = (
    "--steps 700 --initial.gaussians 4000 --density.max-gaussians 6000 --density.until 500 "
    "--inputs blendshapes"
)
COVERED = 0.9
"""Share of a pixel above which the head alone is measured there."""
DARK = 0.1
"""Colours below this, in either light, tell nothing about light: brows, nostrils, pupils."""
FINE = 4.0
"""Standard deviation in pixels below which a change of light is fine enough to be a blotch."""
RIM = 6
"""Width in pixels of the edge of the drawn head, where the neck begins."""
SHOWN, ENLARGED, TILE = 3, 520, 280
"""Pictures that are shown, the size to which they are enlarged, and that of the part shown."""


@dataclass(frozen=True)
class Relight:
    """The bench.

    Attributes:
        subject: Subject file (.npz) of ico3d capture synthetic, with a body.
        work: Folder for recordings and head.
        picture: Where to write the picture.
    """

    subject: tyro.conf.Positional[Path]
    work: Path
    picture: Path | None = None

    def run(self) -> None:
        """Records, trains, relights, measures, draws."""
        torch.set_num_threads(1)
        for name, shot in SHOTS.items():
            if not (self.work / name / "capture.json").exists():
                words = ["capture", "synthetic", str(self.work / name), *shot.split()]
                _command([*words, "--subject", str(self.subject)])
        if not (self.work / "model" / "finished.json").exists():
            places = [str(self.work / "head"), str(self.work / "model")]
            _command(["train", "head", *places, *TRAINING.split()])
        body, whole = open_capture(self.work / "body"), TrainedHead.load(self.work / "model")
        assert whole.landmarks is not None
        region = HeadRegion.around(whole.landmarks)
        head = cropped(whole, region)
        placement = align(body, whole.landmarks, print)
        views = face_views(body, placement, region, whole.landmarks)
        expressions = recorded_expressions(head, body, head.neutral())
        there = relit(head.model, whole.landmarks, placement, expressions, views)
        looks = _looks(open_capture(self.work / "head"), open_capture(self.work / "truth"), head)
        before = [look.drawn(head.model) for look in looks]
        print("own light", scores(before, before, looks))
        print("relit", scores([look.drawn(there) for look in looks], before, looks))
        print("truth", scores([k.truth for k in looks], [k.own for k in looks], looks))
        pairs = zip(before, looks, strict=True)
        own = [np.square(drawn - look.own)[look.inside].mean() for drawn, look in pairs]
        print(f"the head in its own light, against its own pictures: {_db(own):.2f} dB")
        if self.picture:
            _sheet(looks, (head.model, there)).save(self.picture, quality=88)


@dataclass(frozen=True)
class Look:
    """A test picture in both lights.

    Attributes:
        camera: The camera.
        where: (4, 4) pose of the head.
        expression: (B,) expression of the head.
        own: (H, W, 3) the person in the head's light.
        truth: (H, W, 3) the person in the body's light.
        inside: (H, W) bool: pixels that the drawn head covers.
    """

    camera: Camera
    where: np.ndarray
    expression: torch.Tensor
    own: np.ndarray
    truth: np.ndarray
    inside: np.ndarray

    @torch.no_grad()
    def drawn(self, model: HeadModel) -> np.ndarray:
        """(H, W, 3) a head, over the person in the body's light."""
        there = model(self.expression).transform(self.where)
        return render(there, [self.camera], torch.from_numpy(self.truth)).rgb[0].numpy()


def _looks(near: Capture, warm: Capture, head: TrainedHead) -> list[Look]:
    """The test pictures of a head's recording, with their truth in another light."""
    track, looks = head.track(near), []
    for frame in near.split.test:
        for index, camera in enumerate(near.cameras):
            own, truth, mask = (
                near.image(index, frame),
                warm.image(index, frame),
                near.mask(index, frame),
            )
            where = near.world_from_head(frame)
            if own is None or truth is None or mask is None or where is None:
                continue
            expression = track.at(frame)
            with torch.no_grad():
                drawn = render(head.model(expression).transform(where), [camera])
            inside = (drawn.alpha[0].numpy() > COVERED) & (mask > COVERED)
            looks.append(Look(camera, where, expression, own, truth, inside))
    return looks


def scores(
    drawn: list[np.ndarray], before: list[np.ndarray], looks: list[Look]
) -> dict[str, float]:
    """Means over pictures of how a head looks in the body's light.

    `face`: dB where the head is drawn. `step`: length of the mean RGB difference from the truth
    along the edge of the drawn head, next to which the body is. `blotch`: root mean square of what
    is fine in the hue of the change of light, in logits of colour. `detail`: correlation with the
    truth of what is fine in brightness.
    """
    pairs = list(zip(drawn, looks, strict=True))
    errors = [np.square(d - k.truth)[k.inside].mean() for d, k in pairs]
    steps = [np.linalg.norm((d - k.truth)[_rim(k)].mean(0)) for d, k in pairs]
    trios = zip(drawn, before, looks, strict=True)
    spots = [_blotch(there, here, look.inside) for there, here, look in trios]
    found = {"face": _db(errors), "step": np.mean(steps), "blotch": np.mean(spots)}
    fine = [(_fine(d)[k.inside], _fine(k.truth)[k.inside]) for d, k in pairs]
    found["detail"] = np.mean([np.corrcoef(*both)[0, 1] for both in fine])
    return {name: round(float(value), 4) for name, value in found.items()}


def _db(errors: list[np.floating]) -> float:
    return decibels(float(np.mean(errors)))


def _rim(look: Look) -> np.ndarray:
    """(H, W) bool: the lower edge of the drawn head, where the neck begins."""
    rim = look.inside & ~np.asarray(binary_erosion(look.inside, iterations=RIM), bool)
    rows = np.flatnonzero(look.inside.any(1))
    rim[: int(rows.min() + 0.6 * (rows.max() - rows.min()))] = False
    return rim


def _blotch(drawn: np.ndarray, before: np.ndarray, inside: np.ndarray) -> float:
    """How much the hue of the change of light between two pictures varies within few pixels."""
    told = (np.minimum(drawn, before) > DARK).all(-1) & inside  # (H, W)
    logits = [np.log(c / (1 - c)) for c in (x.clip(0.01, 0.99) for x in (drawn, before))]
    change = logits[0] - logits[1]  # (H, W, 3)
    hue = (change - change.mean(-1, keepdims=True)) * told[..., None]  # (H, W, 3)
    share = np.maximum(gaussian_filter(told.astype(float), FINE), 1e-6)[..., None]  # (H, W, 1)
    fine = hue - gaussian_filter(hue, (FINE, FINE, 0)) / share
    return float(np.sqrt(np.square(fine[told]).mean()))


def _fine(picture: np.ndarray) -> np.ndarray:
    """(H, W) what is fine in the brightness of a picture (H, W, 3)."""
    bright = picture.mean(-1)  # (H, W)
    return bright - np.asarray(gaussian_filter(bright, FINE))


def _sheet(looks: list[Look], models: tuple[HeadModel, ...]) -> Image.Image:
    """One row per picture: a head in its own light | relit | the truth."""
    names = sorted({look.camera.name for look in looks})[::2][:SHOWN]
    rows = []
    for look in (next(k for k in looks if k.camera.name == name) for name in names):
        size = ENLARGED, ENLARGED
        near = replace(look, camera=look.camera.resized(*size), truth=_enlarged(look.truth, size))
        grown = ENLARGED / look.inside.shape[0]
        top, left = (int(i.mean() * grown - TILE / 2) for i in np.nonzero(look.inside))
        tiles = [*(near.drawn(model) for model in models), near.truth]
        rows.append(np.hstack([tile[top : top + TILE, left : left + TILE] for tile in tiles]))
    return Image.fromarray((np.vstack(rows).clip(0, 1) * 255 + 0.5).astype(np.uint8))


def _enlarged(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) float32 picture of another size."""
    small = Image.fromarray((picture * 255 + 0.5).astype(np.uint8))
    return np.asarray(small.resize(size, Image.Resampling.BICUBIC), np.float32) / 255


def _command(words: list[str]) -> None:
    if subprocess.run([sys.executable, "-m", "ico3d.cli", *words]).returncode:
        sys.exit(f"ico3d {' '.join(words)} failed.")


if __name__ == "__main__":
    sys.exit(run_script(Relight))
