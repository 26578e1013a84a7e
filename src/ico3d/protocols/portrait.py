"""The protocol of talking portraits: self-driven and cross-driven heads (paper, section 4.2)."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from PIL import Image

from ico3d.capture.capture import Capture, Sound
from ico3d.capture.decoding import to_bytes
from ico3d.capture.formats import open_capture
from ico3d.capture.parts.head_of_body import head_in
from ico3d.capture.parts.held_out import PartOfCapture
from ico3d.capture.sound import read_sound_file
from ico3d.common.device import DeviceName
from ico3d.common.files import write_one_of_many
from ico3d.errors import CaptureError
from ico3d.head.model_folder import TrainedHead
from ico3d.head.settings import HeadSettings
from ico3d.head.train_head import HeadJob, train_head
from ico3d.measure.head import (
    HeadRenderer,
    evaluate_head,
    most_frontal_camera,
    rendered_frames,
)
from ico3d.protocols.charts import draw_training
from ico3d.protocols.cross_driven import CrossDriven
from ico3d.protocols.facts import facts_of
from ico3d.protocols.renders import (
    FACE_COLUMNS,
    LIP_COLUMNS,
    PICTURE_COLUMNS,
    Recorded,
    crop_scores,
    face_box,
    render_pictures,
    sync_row,
)
from ico3d.protocols.report import Column, Picture, Report, Section, Table, Value
from ico3d.protocols.rows import means
from ico3d.splat.device import computing_device

COSTS = (
    Column("num_gaussians", "Gaussians", 0),
    Column("train_seconds", "training, s", 0, "less"),
    Column("fps", "FPS", 1, "more"),
)
PAPER = (
    ("RAD-NeRF", 26.794, 0.901, 0.083, 2.907, 4.988, 25.0),
    ("ER-NeRF", 27.35, 0.904, 0.063, 2.836, 5.172, 35.0),
    ("TalkingGaussian", 29.317, 0.920, 0.046, 2.688, 5.802, 110.0),
    ("GaussianTalker", 29.127, 0.911, 0.085, 2.814, 5.35, 130.0),
    ("HeadGaS++", 30.398, 0.935, 0.051, 2.793, 5.928, 250.0),
)
"""The paper's self-driven table on four clips: PSNR, SSIM, LPIPS, LMD, Sync-C, FPS."""


@dataclass(frozen=True)
class PortraitTerms:
    """What is trained and measured.

    Attributes:
        capture: Path of the recording, a talking portrait.
        out: Folder of trainings and report.
        seeds: Seeds of the trainings.
        encoder: Speech encoder.
        over_torso: Whether the head alone is learnt, and compared over the recorded torso.
        settings: How heads are trained.
        sounds: Sounds by other people, for the cross-driven setting.
        against: Recordings of the same person with other words, which allow to compare lips.
        device: Where to compute.
    """

    capture: Path
    out: Path
    seeds: tuple[int, ...]
    encoder: str
    over_torso: bool
    settings: HeadSettings
    sounds: tuple[Path, ...] = ()
    against: tuple[Path, ...] = ()
    device: DeviceName = "auto"

    def head(self, seed: int) -> TrainedHead:
        """The head of a seed, trained now or found in its folder."""
        job = HeadJob(
            "speech", "full", self.encoder, seed, self.settings, over_torso=self.over_torso
        )
        folder = self.out / f"seed{seed}"
        head = train_head(open_capture(self.capture), folder, job, device=self.device)
        return head.to(computing_device(self.device))

    def shown(self, capture: Capture, frames: Sequence[int]) -> Capture:
        """The pictures of some frames of a recording, as heads are compared with them."""
        cameras = range(len(capture.cameras))
        return head_in(PartOfCapture(capture, cameras, frames), self.over_torso)


def measure_portrait(terms: PortraitTerms) -> Report:
    """Trains heads, measures them self-driven and cross-driven, and writes a report.

    Raises:
        CaptureError: If the recording has no sound, or no test frames.
    """
    capture, device = open_capture(terms.capture), computing_device(terms.device)
    test, sound = capture.split.test, capture.audio()
    if not test or sound is None:
        raise CaptureError(f"{capture.path} has no {'sound' if test else 'test frames'}.")
    heads = {seed: terms.head(seed) for seed in terms.seeds}
    rows, folders = [], {}
    recorded = None
    for seed, head in heads.items():
        pictures = terms.out / f"seed{seed}" / "pictures"
        found = evaluate_head(head, terms.shown(capture, test), test, pictures)
        camera = capture.cameras[most_frontal_camera(capture, test)].name
        recorded = recorded or _recorded(capture, test, pictures, camera, sound)
        rendered = pictures / "pred" / camera
        rows.append({"name": f"seed {seed}", **found, **crop_scores(rendered, recorded, device)})
        folders[f"seed {seed}"] = rendered
    assert recorded is not None, "there is at least one seed"
    whole = [{"name": "mean", **means(rows)}, *rows] if len(rows) > 1 else rows
    truth = {"name": "recorded", **sync_row(recorded.pictures, recorded, device)}
    sections = [
        Section("Self-driven: whole pictures", _how(terms, capture), Table(
            (*PICTURE_COLUMNS, *COSTS), whole)),
        Section("Self-driven: the head and the face", _FACES, Table(FACE_COLUMNS, whole)),
        Section("Self-driven: lips", table=Table(LIP_COLUMNS, [truth, *whole])),
        *_cross(terms, heads, capture),
        Section("Pictures", pictures=[
            _training(terms.out, heads), *render_pictures(terms.out, recorded, folders)]),
        _paper(),
    ]  # fmt: skip
    facts = facts_of(
        device,
        capture=str(terms.capture),
        seeds=", ".join(map(str, terms.seeds)),
        encoder=terms.encoder,
        composition="head over recorded torso" if terms.over_torso else "whole person",
        settings=asdict(terms.settings),
    )
    report = Report("How good is a talking head?", facts, sections, {"self-driven": rows})
    report.write(terms.out)
    return report


def _recorded(
    capture: Capture, test: Sequence[int], pictures: Path, camera: str, sound: Sound
) -> Recorded:
    """The recorded test frames as `evaluate_head` wrote them, with sound and face."""
    begin = round(test[0] / capture.fps * sound.rate)
    index = next(i for i, c in enumerate(capture.cameras) if c.name == camera)
    marks = [m for f in test if (m := capture.landmarks(index, f)) is not None]
    heard = Sound(sound.samples[begin:], sound.rate)
    masks = pictures / "mask" / camera
    return Recorded(
        pictures / "gt" / camera,
        capture.fps,
        masks if os.path.isdir(masks) else None,
        heard,
        face_box(marks),
    )


def _cross(
    terms: PortraitTerms, heads: Mapping[int, TrainedHead], capture: Capture
) -> list[Section]:
    """Heads driven by other sounds, and by recordings of other words."""
    rows = [
        {"name": f"{path.stem}, seed {seed}", **_driven(terms, head, seed, capture, path)}
        for path in terms.sounds
        for seed, head in heads.items()
    ]
    for path in terms.against:
        other = open_capture(path)
        frames = range(other.num_frames)
        for seed, head in heads.items():
            found = evaluate_head(head, terms.shown(other, frames), frames, None)
            rows.append({"name": f"{path.name}, seed {seed}", **found})
    if not rows:
        return []
    columns = [column for column in LIP_COLUMNS if column.key != "temporal_flicker"]
    text = (
        "Heads driven by sounds that they never heard, in poses and before the background of the "
        "test frames, there and back; lips can only be compared with recordings of these words."
    )
    return [Section("Cross-driven", text, Table(columns, rows, "driven by"))]


def _driven(
    terms: PortraitTerms, head: TrainedHead, seed: int, capture: Capture, path: Path
) -> dict[str, Value]:
    """SyncNet's scores of a head that a sound drives; the pictures stay in the seed's folder."""
    sound = read_sound_file(path)
    if sound is None:
        raise CaptureError(f"there is no sound at {path}.")
    shown = terms.shown(capture, capture.split.test)
    driven = CrossDriven(shown, capture.split.test, sound, path.stem)
    renderer, folder = HeadRenderer(head, driven), terms.out / f"seed{seed}" / f"to-{path.stem}"
    folder.mkdir(parents=True, exist_ok=True)
    camera = most_frontal_camera(capture, capture.split.test)
    frames = range(driven.num_frames)
    for frame, picture in rendered_frames(renderer, driven, camera, frames, path.stem):
        write_one_of_many(folder / f"{frame:06d}.png", Image.fromarray(to_bytes(picture)).save)
    recorded = Recorded(folder, capture.fps, None, sound, None)
    return sync_row(folder, recorded, computing_device(terms.device))


def _how(terms: PortraitTerms, capture: Capture) -> str:
    train, test = len(capture.split.train), len(capture.split.test)
    over = (
        "The head alone is learnt, and drawn over the recorded torso and the clean plate, as "
        "TalkingGaussian and ER-NeRF are measured."
        if terms.over_torso
        else "The whole person is drawn before the clean plate."
    )
    first = capture.cameras[0]
    return (
        f"{train} frames train, {test} test; pictures of {first.width} × {first.height} pixels, "
        f"compared whole, as PNG files, not as compressed videos. {over} Driven by the recorded "
        "speech; poses and eyes are those of the recording."
    )


_FACES = (
    "The crop holds all 68 landmarks of all test frames, with a quarter of its longer side around."
)


def _training(out: Path, heads: Mapping[int, TrainedHead]) -> Picture:
    """A plot of the trainings."""
    runs = {
        f"seed {seed}": (out / f"seed{seed}", head.summary["train_seconds"])
        for seed, head in heads.items()
    }
    draw_training(out / "training.png", runs)
    return Picture("training.png", "Quality of training pictures by time and number of Gaussians")


def _paper() -> Section:
    """The paper's own table."""
    keys = ("psnr", "ssim", "lpips_alex", "lmd", "sync_c", "fps")
    known = {column.key: column for column in (*PICTURE_COLUMNS, *LIP_COLUMNS, *COSTS)}
    rows = [{"name": name, **dict(zip(keys, values, strict=True))} for name, *values in PAPER]
    text = (
        "Means of four clips of 6,500 frames; pictures of H.264 videos. Comparable with the tables "
        "above only on the same clips; the paper does not tell what is composited."
    )
    return Section("The paper's figures", text, Table([known[key] for key in keys], rows, "method"))
