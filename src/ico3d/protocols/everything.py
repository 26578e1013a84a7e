"""All protocols in one run, on given recordings or on synthetic ones in the data sets' layouts."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import rmtree
from typing import TypeVar

from rich.console import Console

from ico3d.body.settings import BodySettings, Method
from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.common.device import DeviceName
from ico3d.common.presets import PresetName
from ico3d.errors import Ico3dError
from ico3d.head.settings import PRESETS, HeadSettings
from ico3d.measure.methods.bench import terms_for
from ico3d.measure.methods.settings import OURS, preset
from ico3d.protocols.ablations import AblationTerms, Model, measure_ablations
from ico3d.protocols.body import measure_body
from ico3d.protocols.facts import facts_of
from ico3d.protocols.portrait import PortraitTerms, measure_portrait
from ico3d.protocols.report import MARKDOWN, Report, Section
from ico3d.protocols.viewer import measure_viewer
from ico3d.splat.device import computing_device, decided
from ico3d.studio.layouts.portrait import write_portrait
from ico3d.studio.layouts.smc import write_dna
from ico3d.studio.recording import Recording, record

Settings = TypeVar("Settings", HeadSettings, BodySettings)


@dataclass(frozen=True)
class Size:
    """How large synthetic recordings and trainings are.

    Attributes:
        head_frames: Frames of the portrait, 25 per second; 1/11 of them test.
        head_pixels: Height and width of its pictures.
        body_cameras: Cameras around the whole person.
        body_frames: Frames of the whole person, 15 per second.
        body_pixels: Height of the pictures of the whole person.
        head_steps: Steps of a head; those of the preset if None.
        body_steps: Steps of a body's window; those of the preset if None.
        gaussians: Most Gaussians of a head, and of a body's window; those of the presets if None.
        seeds: Number of trainings of each kind.
    """

    head_frames: int = 1100
    head_pixels: int = 256
    body_cameras: int = 20
    body_frames: int = 41
    body_pixels: int = 288
    head_steps: int | None = None
    body_steps: int | None = None
    gaussians: int | None = None
    seeds: int = 3


SMALL = Size(220, 192, 10, 17, 192, 500, 400, 3_000, 1)
"""Two cores measure everything at this size in well under 40 minutes."""
METHODS: tuple[Method, ...] = ("swings++", "swings", "spacetime", "4dgs")
"""The methods of the paper's table that need no skeleton."""


@dataclass(frozen=True)
class AllTerms:
    """What is measured.

    Attributes:
        out: Folder of recordings, trainings and reports.
        portraits: Talking portraits; a synthetic one if empty.
        bodies: Recordings of whole persons; a synthetic one if empty.
        avatar: Folder of `ico3d assemble`, or a bundle.
        subject: Subject of synthetic recordings.
        size: Size of synthetic recordings, and of trainings.
        preset: Preset of the settings.
        device: Where to compute.
    """

    out: Path
    portraits: tuple[Path, ...]
    bodies: tuple[Path, ...]
    avatar: Path
    subject: str
    size: Size
    preset: PresetName
    device: DeviceName

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of the trainings."""
        return tuple(range(self.size.seeds))

    def head(self) -> HeadSettings:
        """Settings of heads."""
        settings, size = PRESETS[self.preset], self.size
        if size.head_steps is not None:
            until = min(settings.density.until, 2 * size.head_steps // 3)
            density = replace(settings.density, begin=until // 4, until=until)
            settings = replace(settings, steps=size.head_steps, density=density)
        return self._limited(settings)

    def body(self) -> BodySettings:
        """Settings of SWinGS++."""
        settings, size = preset(OURS, self.preset), self.size
        if size.body_steps is not None:
            warm = min(settings.warmup_steps, size.body_steps // 10)
            settings = replace(
                settings,
                steps=size.body_steps,
                steps_per_frame=0,
                warmup_steps=warm,
                density=replace(settings.density, begin=warm),
            )
        return self._limited(settings)

    def _limited(self, settings: Settings) -> Settings:
        """Settings with as many Gaussians as the size allows."""
        most = self.size.gaussians
        if most is None:
            return settings
        return replace(
            settings,
            initial=replace(settings.initial, gaussians=2 * most // 3),
            density=replace(settings.density, max_gaussians=most),
        )


Protocol = tuple[str, Callable[[Path], Report]]
"""The name of a folder, and what measures into it."""


def measure_all(terms: AllTerms) -> Report:
    """Runs every protocol, one after another, and writes a report of all.

    What is there already is not trained again. A protocol that fails is told in the report, and
    the others run all the same.
    """
    console, sections = Console(), []
    for name, measured in protocols(terms):
        console.rule(name)
        try:
            report = measured(terms.out / name)
        except Ico3dError as error:
            console.print(f"{name}: {error}")
            sections.append(Section(name, f"Failed: {error}"))
            continue
        text = report.markdown(2, f"{name}/") + f"\n\n[Alone]({name}/{MARKDOWN})"
        sections.append(Section(name, text))
    facts = facts_of(computing_device(terms.device), preset=terms.preset, size=repr(terms.size))
    whole = Report("All protocols", facts, sections)
    whole.write(terms.out)
    return whole


def protocols(terms: AllTerms) -> list[Protocol]:
    """All protocols, in the order in which they run."""
    portraits = terms.portraits or (synthetic_portrait(terms),)
    bodies = terms.bodies or (synthetic_body(terms),)
    return [
        ("viewer", lambda out: _viewer(terms, out)),
        *_each("portrait", portraits, lambda path, out: _portrait(terms, path, out)),
        *_each("body", bodies, lambda path, out: _body(terms, path, out)),
        ("head-ablations", lambda out: _ablations(terms, "head", portraits[0], out)),
        ("body-ablations", lambda out: _ablations(terms, "body", bodies[0], out)),
    ]


def _each(
    name: str, paths: Sequence[Path], measured: Callable[[Path, Path], Report]
) -> list[Protocol]:
    """A protocol for each recording; folders are numbered where there are several."""

    def of(path: Path) -> Callable[[Path], Report]:
        return lambda out: measured(path, out)

    several = len(paths) > 1
    return [(f"{name}-{k}" if several else name, of(path)) for k, path in enumerate(paths, 1)]


def _viewer(terms: AllTerms, out: Path) -> Report:
    return measure_viewer(terms.avatar, out, None, computing_device(terms.device))


def _portrait(terms: AllTerms, path: Path, out: Path) -> Report:
    sound = open_capture(path).audio()
    against = () if terms.portraits or sound is None else (other_words(terms),)
    return measure_portrait(
        PortraitTerms(
            path,
            out,
            terms.seeds,
            "builtin",
            True,
            terms.head(),
            against=against,
            device=terms.device,
        )
    )


def _body(terms: AllTerms, path: Path, out: Path) -> Report:
    device = decided(terms.device)
    of_all = terms_for(path, None, out, terms.body(), False, device, preset=terms.preset)
    return measure_body(of_all, METHODS, terms.seeds, 1, out)


def _ablations(terms: AllTerms, model: Model, path: Path, out: Path) -> Report:
    return measure_ablations(
        AblationTerms(
            path,
            out,
            model,
            seeds=terms.seeds,
            preset=terms.preset,
            device=terms.device,
            settings=terms.head() if model == "head" else terms.body(),
        )
    )


def synthetic_portrait(terms: AllTerms) -> Path:
    """A talking portrait of a person who does not exist, in the layout of such data sets."""
    return _portrait_of(terms, "portrait", "", 0, terms.size.head_frames)


def other_words(terms: AllTerms) -> Path:
    """The same person with other words, which train nothing."""
    text = "Bright vixens jump, dozy fowl quack; who mixed up five boxing wizards?"
    return _portrait_of(terms, "other-words", text, 1, max(33, terms.size.head_frames // 8))


def synthetic_body(terms: AllTerms) -> Path:
    """A whole person who does not exist, in the layout of DNA-Rendering."""
    size = terms.size
    recording = Recording(
        subject=terms.subject,
        rig="body",
        cameras=size.body_cameras,
        frames=size.body_frames,
        fps=15.0,
        views_per_frame=size.body_cameras,
        size=size.body_pixels,
        text="",
        seed=0,
        lively=True,
        light="studio",
        motion="showcase",
    )
    return _synthetic(
        terms, "body", recording, lambda capture, to: write_dna(capture, to, "0000_00")
    )


def _portrait_of(terms: AllTerms, name: str, text: str, seed: int, frames: int) -> Path:
    recording = Recording(
        subject=terms.subject,
        rig="head",
        cameras=1,
        frames=frames,
        fps=25.0,
        views_per_frame=1,
        size=terms.size.head_pixels,
        text=text,
        seed=seed,
        lively=True,
        light="studio",
        motion="talk",
    )
    return _synthetic(terms, name, recording, write_portrait)


def _synthetic(
    terms: AllTerms, name: str, recording: Recording, write: Callable[[Capture, Path], Path]
) -> Path:
    """A recording in a data set's layout, made now unless it is there."""
    folder = terms.out / "recordings"
    studio, written = folder / f"studio-{name}", folder / name
    if os.path.isdir(written):
        return written
    if not os.path.isfile(studio / "capture.json"):
        record(recording, studio, 2)
    _whole(written, lambda to: write(open_capture(studio), to))
    return written


def _whole(folder: Path, write: Callable[[Path], Path]) -> None:
    """Writes a folder that is there only once it is whole."""
    unfinished = folder.with_name(folder.name + ".unfinished")
    if os.path.islink(unfinished):
        unfinished.unlink()
    rmtree(unfinished, ignore_errors=True)
    write(unfinished)
    unfinished.rename(folder)
