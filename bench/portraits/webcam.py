"""What a webcam's faults cost a head, and whether it learns some people worse than others.

    ICO3D_MODELS=MODELS python bench/portraits/webcam.py --work WORK [--seeds 3] [--json F]

Synthetic people talk before one camera. What a webcam with a fault makes of it, an H.264 film, goes
the way of `ico3d create`: MediaPipe tracks it, a head learns from it. The head is then drawn in the
film's last eleventh, which it never saw, and compared with the clean pictures of the same moments
on the true face (within jaw and brows) and head (with hair). What WORK holds already is not made
again; a case of an earlier version of the code, or of other options, is made again once its folder
is removed.
"""

import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.portrait import parsing
from ico3d.capture.portrait.settings import PortraitSettings
from ico3d.capture.portrait.track import track_portrait
from ico3d.cli import run_script
from ico3d.common.psnr import psnr
from ico3d.creating.settings import QUALITIES, QualityName
from ico3d.head.model_folder import TrainedHead
from ico3d.head.settings import Initial
from ico3d.head.train_head import HeadJob, train_head
from ico3d.head.views import view_of
from ico3d.measure.head import HeadRenderer
from ico3d.studio.layouts.portrait import parted
from ico3d.studio.person.traits.names import TRAITS, TraitName
from ico3d.studio.recording import Recording, record
from ico3d.studio.webcam.faults import FAULTS, FaultName
from ico3d.studio.webcam.film import webcam_of, write_film

PEOPLE_FPS = 12.5
"""Pictures per second of films that compare people: half as many to draw."""
WORKERS = 2


@dataclass(frozen=True)
class Case:
    """A film of a person.

    Attributes:
        name: What the table calls it.
        faults: What the webcam does wrong.
        fps: Pictures per second.
        traits: What the person has.
    """

    name: str
    faults: tuple[FaultName, ...] = ()
    fps: float = 25.0
    traits: tuple[TraitName, ...] = ()


FILMS = (
    Case("clean"),
    *(Case(fault, (fault,)) for fault in FAULTS),
    Case("all faults", FAULTS),
)
PEOPLE = (
    Case("plain", fps=PEOPLE_FPS),
    *(Case(trait, fps=PEOPLE_FPS, traits=(trait,)) for trait in TRAITS),
)


@dataclass(frozen=True)
class Webcam:
    """The bench.

    Attributes:
        work: Folder for recordings, films and heads.
        seeds: Number of recordings and trainings of each case.
        only: Names of cases; all by default.
        seconds: Length of each film.
        size: Height and width of the pictures.
        quality: How `ico3d create` would track and train.
        steps: Steps of each training, instead of that quality's.
        gaussians: Most Gaussians of a head; a training begins with two thirds of them.
        json: Where to write the figures.
    """

    work: Path
    seeds: int = 1
    only: tuple[str, ...] = ()
    seconds: float = 20.0
    size: int = 320
    quality: QualityName = "quick"
    steps: int = 250
    gaussians: int = 6_000
    json: Path | None = None

    def run(self) -> None:
        """Records, tracks, trains, measures; prints the table."""
        wanted = [case for case in (*FILMS, *PEOPLE) if not self.only or case.name in self.only]
        rows = [self._row(case, seed) for seed in range(self.seeds) for case in wanted]
        for title, cases in (("film", FILMS), ("person", PEOPLE)):
            names = {case.name for case in cases}
            found = [row for row in rows if row["case"] in names]
            if found:
                print(_table(title, cases[0].name, found))
        if self.json:
            self.json.write_text(json.dumps(rows, indent=1) + "\n")

    def _row(self, case: Case, seed: int) -> dict:
        """The figures of a case."""
        folder = self.work / f"{case.name.replace(' ', '-')}-{seed}"
        done = folder / "figures.json"
        if not done.is_file():
            folder.mkdir(parents=True, exist_ok=True)
            truth = self._recorded(case, seed)
            head, capture = self._learnt(case, truth, folder, seed)
            figures = _measured(head, capture, case, truth, seed)
            done.write_text(json.dumps({"case": case.name, "seed": seed} | figures))
        row = json.loads(done.read_text())
        print(row, file=sys.stderr)
        return row

    def _recorded(self, case: Case, seed: int) -> Capture:
        """The clean recording of a case, with the truth of everything."""
        out = self.work / "-".join(["truth", f"{case.fps:g}", *case.traits, str(seed)])
        if not (out / "capture.json").is_file():
            frames = round(self.seconds * case.fps)
            of = ("anny", "bust", 1, frames, case.fps, 1, self.size, "", seed)
            how = Recording(*of, False, "studio", "talk", gaze="visitor", traits=case.traits)
            record(how, out, WORKERS)
        return open_capture(out)

    def _learnt(
        self, case: Case, truth: Capture, folder: Path, seed: int
    ) -> tuple[TrainedHead, Capture]:
        """The head that is learnt from a case's film, and the tracked film."""
        film, tracked = folder / "film.mp4", folder / "capture"
        quality = QUALITIES[self.quality]
        if not film.is_file():
            of = (truth.num_frames, truth.fps, truth.audio(), case.faults, seed)
            write_film(film, lambda frame: _picture(truth, frame), *of)
        if not tracked.exists():
            track_portrait(
                film, tracked, PortraitSettings(refine=quality.refine, most=quality.pictures)
            )
        capture = open_capture(tracked)
        density = replace(
            quality.head.density, until=2 * self.steps // 3, max_gaussians=self.gaussians
        )
        initial = Initial(gaussians=2 * self.gaussians // 3)
        settings = replace(quality.head, steps=self.steps, density=density, initial=initial)
        job = HeadJob("speech", "full", "builtin", seed, settings)
        return train_head(capture, folder / "head", job, device="cpu"), capture


def _picture(truth: Capture, frame: int) -> np.ndarray:
    picture = truth.image_bytes(0, frame)
    assert picture is not None  # one camera, which takes every frame
    return picture


def _measured(head: TrainedHead, capture: Capture, case: Case, truth: Capture, seed: int) -> dict:
    """dB on face and head over the test pictures that came when they should."""
    shown = webcam_of(case.faults, truth.num_frames, truth.fps, seed).shown
    fresh = {one.at for one in shown if one.at == one.frame}
    renderer, found = HeadRenderer(head, capture), []
    plate = truth.background(0)
    assert plate is not None
    for number in capture.split.test:
        frame = round(number / capture.fps * truth.fps)
        if frame not in fresh or abs(frame / truth.fps - number / capture.fps) > 1e-6:
            continue
        drawn = renderer.picture(view_of(capture, 0, number), torch.from_numpy(plate))
        image, mask, marks = truth.image(0, frame), truth.mask(0, frame), truth.landmarks(0, frame)
        assert image is not None and mask is not None and marks is not None
        parts = parted(mask, marks)
        face = parsing.is_class(parts, parsing.FACE, parsing.MOUTH)
        whole = parsing.is_class(parts, parsing.FACE, parsing.MOUTH, parsing.HAIR)
        found.append((psnr(drawn, image, face), psnr(drawn, image, whole)))
    face, whole = np.mean(np.array(found, float), 0).tolist()
    return {
        "face": face,
        "head": whole,
        "pictures": len(found),
        "trained_on": len(capture.split.train),
        "seconds": head.summary.get("train_seconds"),
    }


def _table(title: str, base: str, rows: list[dict]) -> str:
    """Means over the seeds, as Markdown; differences are those from the case named `base`."""
    lines = [f"| {title} | face, dB | head, dB | face against {base} |", "|---|---|---|---|"]
    names = dict.fromkeys(row["case"] for row in rows)
    means = {
        name: [np.mean([r[key] for r in rows if r["case"] == name]) for key in ("face", "head")]
        for name in names
    }
    for name, (face, whole) in means.items():
        less = f"{face - means[base][0]:+.2f}" if base in means else "–"
        lines.append(f"| {name} | {face:.2f} | {whole:.2f} | {less} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(run_script(Webcam))
