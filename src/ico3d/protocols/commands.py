"""The verbs `ico3d measure …`: protocols that train, measure and write a report."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from ico3d.body.settings import SKINNED, BodySettings, Method
from ico3d.common.device import DeviceName
from ico3d.common.presets import PresetName, chosen
from ico3d.head.commands import HeadChoice
from ico3d.head.settings import PRESETS, HeadSettings
from ico3d.measure.methods.settings import OURS, preset


@dataclass(frozen=True)
class MeasureViewer:
    """Times how fast a person is drawn: background, body, head and all, at 512² and 1080p.

    Attributes:
        model: A person, as written by ico3d assemble, or a bundle; `demo` is that of the package.
        out: Folder of the report.
        background: Folder of ico3d train static; by default a bundle's own background.
        device: Where to compute: by default CUDA where that works, else the CPU.
    """

    model: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    background: Path | None = None
    device: DeviceName = "auto"

    def run(self) -> None:
        """Measures, and writes the report."""
        from ico3d.protocols.viewer import measure_viewer
        from ico3d.splat.device import computing_device

        device = computing_device(self.device)
        _say(measure_viewer(self.model, self.out, self.background, device).markdown(), self.out)


@dataclass(frozen=True)
class MeasurePortrait(HeadChoice):
    """Trains heads on a talking portrait and measures them, self-driven and cross-driven.

    Heads are driven by speech. The same command continues an interrupted run.

    Attributes:
        capture: A talking portrait with its sound; the last 1/11 of its frames tests.
        out: Folder for the report, the trainings and their pictures.
        seeds: Number of trainings, each with another seed.
        encoder: Speech encoder: builtin, ave (SyncTalk's) or hubert.
        over_torso: Learn the head alone and compare it over the recorded torso of each frame, as
            other papers do; else the whole person is drawn.
        sounds: Sounds of other people that drive the heads.
        against: Recordings of the same person with other words, to compare lips with.
        device: Where to compute: by default CUDA where that works, else the CPU.
        settings: How heads are trained.
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    seeds: int = 1
    encoder: str = "builtin"
    over_torso: bool = True
    sounds: tuple[Path, ...] = ()
    against: tuple[Path, ...] = ()
    device: DeviceName = "auto"
    settings: Annotated[HeadSettings, tyro.conf.arg(name="")] = PRESETS["cpu"]

    @classmethod
    def defaults(cls, words: Sequence[str]) -> "MeasurePortrait":
        """The verb with the settings of the preset that `words` choose."""
        settings = PRESETS[chosen(HeadChoice, words).preset]
        return cls(tyro.MISSING, tyro.MISSING, settings=settings)

    def run(self) -> None:
        """Trains and measures what is missing, and writes the report.

        Raises:
            SettingsError: If no training is asked for.
        """
        from ico3d.protocols.portrait import PortraitTerms, measure_portrait

        terms = PortraitTerms(
            self.capture,
            self.out,
            _seeds(self.seeds),
            self.encoder,
            self.over_torso,
            self.settings,
            self.sounds,
            self.against,
            self.device,
        )
        _say(measure_portrait(terms).markdown(), self.out)


@dataclass(frozen=True)
class MeasureRenders:
    """Scores pictures or videos of a talking head against the recorded ones, whoever made them.

    Attributes:
        out: Folder of the report.
        recorded: Folder of the recorded pictures, in the order of their names, or a video.
        rendered: Folders of rendered pictures, as many and in the same order, or videos.
        masks: Folder of masks of the head, one for each picture, for the PSNR on it.
        sound: The sound from the first picture on, for SyncNet.
        fps: Pictures per second.
        device: Where to compute: by default CUDA where that works, else the CPU.
    """

    out: tyro.conf.Positional[Path]
    recorded: Path
    rendered: tuple[Path, ...]
    masks: Path | None = None
    sound: Path | None = None
    fps: float = 25.0
    device: DeviceName = "auto"

    def run(self) -> None:
        """Scores the pictures, and writes the report."""
        from ico3d.protocols.renders import measure_renders, recorded_side
        from ico3d.splat.device import computing_device

        side = recorded_side(self.recorded, self.fps, self.masks, self.sound)
        device = computing_device(self.device)
        _say(measure_renders(self.rendered, side, self.out, device).markdown(), self.out)


@dataclass(frozen=True, kw_only=True)
class BodyPreset:
    """The option that decides the defaults of all settings.

    Attributes:
        preset: The paper's settings, or settings sized for two CPU cores; all methods take theirs.
            The defaults shown here are those of SWinGS++ in the chosen preset.
    """

    preset: PresetName = "cpu"


@dataclass(frozen=True)
class MeasureBody(BodyPreset):
    """Trains SWinGS++ and methods to compare with on one recording, and measures all of them.

    All methods have equal numbers of Gaussians and steps: one that takes the clip as a single
    window has those of all windows together; one on a skeleton has as many Gaussians as one window.
    All start on the visual hull, or on the skin. The same command continues an interrupted run.

    Attributes:
        capture: A recording of a whole person by at least three cameras.
        out: Folder for the report and the trainings.
        seeds: Number of trainings of each method, each with another seed.
        methods: Methods to train; skinned and hugs, which need a body track, only if they are
            named.
        frames: Use only this many of the first frames; by default all.
        unseen: Also measure the frames that --frames leaves out: a body on a skeleton takes the
            poses of the body track, others stay as they were in the last trained frame.
        finetune: Fine-tune SWinGS++ at the end and measure before and after; the table shows the
            state before.
        equal_drawn: Give methods of a single window only as many Gaussians as one window of
            SWinGS++ has: all draw equally many per picture, and take equally long.
        device: Where to compute: by default CUDA where that works, else the CPU.
        jobs: Number of trainings at a time, which share the cores.
        settings: How SWinGS++ is trained. The other methods are trained in the same way, except
            where their papers differ; options given here apply to all methods.
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    seeds: int = 1
    methods: tuple[Method, ...] = tuple(m for m in get_args(Method) if m not in SKINNED)
    frames: int | None = None
    unseen: bool = False
    finetune: bool = False
    equal_drawn: bool = False
    device: DeviceName = "auto"
    jobs: int = 1
    settings: Annotated[BodySettings, tyro.conf.arg(name="")] = field(
        default_factory=partial(preset, OURS)
    )

    @classmethod
    def defaults(cls, words: Sequence[str]) -> "MeasureBody":
        """The verb with the settings of the preset that `words` choose."""
        settings = preset(OURS, chosen(BodyPreset, words).preset)
        return cls(tyro.MISSING, tyro.MISSING, settings=settings)

    def run(self) -> None:
        """Trains and measures what is missing, and writes the report.

        Raises:
            SettingsError: If a number makes no sense.
        """
        from ico3d.errors import SettingsError
        from ico3d.measure.methods.bench import terms_for
        from ico3d.protocols.body import measure_body
        from ico3d.splat.device import decided

        if self.jobs < 1 or (self.frames or 2) < 2:
            raise SettingsError("--jobs must be at least 1, and --frames at least 2.")
        seeds = _seeds(self.seeds)
        terms = terms_for(
            self.capture,
            self.frames,
            self.out,
            self.settings,
            self.finetune,
            decided(self.device),
            self.unseen,
            self.preset,
        )
        terms = replace(terms, equal_drawn=self.equal_drawn)
        report = measure_body(terms, self.methods, seeds, self.jobs, self.out)
        _say(report.sections[0].markdown(1), self.out)


@dataclass(frozen=True)
class MeasureAblations:
    """Trains a method without one of its parts at a time, and measures what each part is worth.

    The same command continues an interrupted run.

    Attributes:
        capture: A recording of a head (`--of head`) or of a whole person (`--of body`).
        out: Folder for the report and the trainings.
        of: Whose method.
        only: Parts to leave out, by name; all by default. A wrong name lists them.
        seeds: Number of trainings of each, each with another seed.
        preset: The paper's settings, or settings sized for two CPU cores.
        inputs: What drives heads: speech, or the recording's blendshapes.
        device: Where to compute: by default CUDA where that works, else the CPU.
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    of: Literal["head", "body"]
    only: tuple[str, ...] = ()
    seeds: int = 1
    preset: PresetName = "cpu"
    inputs: Literal["speech", "blendshapes"] = "speech"
    device: DeviceName = "auto"

    def run(self) -> None:
        """Trains and measures what is missing, and writes the report.

        Raises:
            SettingsError: If no training is asked for.
        """
        from ico3d.protocols.ablations import AblationTerms, measure_ablations

        terms = AblationTerms(
            self.capture,
            self.out,
            self.of,
            self.only,
            _seeds(self.seeds),
            self.preset,
            self.inputs,
            self.device,
        )
        _say(measure_ablations(terms).markdown(), self.out)


@dataclass(frozen=True)
class MeasureAll:
    """Runs every protocol and writes one report: viewer, portraits, bodies, ablations.

    Where no recordings are given, people who do not exist are recorded, in the layouts of talking
    portraits and of DNA-Rendering. The same command continues an interrupted run.

    Attributes:
        out: Folder for everything.
        small: Small recordings and short trainings with one seed, within 40 minutes on two cores.
        portraits: Talking portraits, with torso_imgs and bc.jpg.
        bodies: Recordings of whole persons by at least three cameras.
        avatar: A person to draw, of ico3d assemble or a bundle; `demo` is that of the package.
        subject: Who is recorded if no recordings are given: `anny` (pip install
            'ico3d[synthetic]') or an .npz subject file.
        preset: The paper's settings, or settings sized for two CPU cores.
        device: Where to compute: by default CUDA where that works, else the CPU.
    """

    out: tyro.conf.Positional[Path]
    small: bool = False
    portraits: tuple[Path, ...] = ()
    bodies: tuple[Path, ...] = ()
    avatar: Path = Path("demo")
    subject: str = "anny"
    preset: PresetName = "cpu"
    device: DeviceName = "auto"

    def run(self) -> None:
        """Measures what is missing, and writes the reports."""
        from ico3d.protocols.everything import SMALL, AllTerms, Size, measure_all

        terms = AllTerms(
            self.out,
            self.portraits,
            self.bodies,
            self.avatar,
            self.subject,
            SMALL if self.small else Size(),
            self.preset,
            self.device,
        )
        _say(measure_all(terms).markdown(), self.out)


def _seeds(count: int) -> tuple[int, ...]:
    """Seeds of so many trainings.

    Raises:
        SettingsError: If there is none.
    """
    from ico3d.errors import SettingsError

    if count < 1:
        raise SettingsError("--seeds must be at least 1.")
    return tuple(range(count))


def _say(text: str, out: Path) -> None:
    """Shows Markdown, and where the report lies."""
    from rich.console import Console
    from rich.markdown import Markdown

    from ico3d.protocols.report import MARKDOWN

    console = Console()
    console.print(Markdown(text))
    console.print(f"The report lies in {out / MARKDOWN}.")
