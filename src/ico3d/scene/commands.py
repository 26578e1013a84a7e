"""The verb `ico3d train static`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ico3d.common.device import DeviceName
from ico3d.common.presets import PresetName, chosen
from ico3d.scene.settings import PRESETS, SceneSettings, StrategyName, settings_for


@dataclass(frozen=True, kw_only=True)
class SceneChoice:
    """The options that decide the defaults of all others.

    Attributes:
        preset: The settings of 3DGS, or those sized for two CPU cores;
            the defaults shown here are those of the preset that is chosen.
        strategy: How Gaussians multiply: as in 3DGS, or as a Markov chain.
    """

    preset: PresetName = "cpu"
    strategy: StrategyName = "default"


@dataclass(frozen=True)
class TrainStatic(SceneChoice):
    """Trains a static scene (3D Gaussian splatting): a background, or a person who stands still.

    The same command continues an interrupted training.

    Attributes:
        capture: A capture folder.
        out: The model folder to write.
        only: Which part of the pictures to train: all of it; the person alone, which needs masks;
            or the background alone.
        frames: All frames together, or the number of a single frame.
        seed: Seed of all random numbers.
        device: Where to compute: by default CUDA where that works, else the CPU.
        export: Also write a file for other programs: .ply (lossless) or .spz (small; for scenes of
            avatars).
        dry_run: Only say how much time, memory and disk the training takes; a few of its steps are
            done, and nothing is written.
        settings: How the scene is trained.
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    only: Literal["all", "person", "background"] = "all"
    frames: Literal["all"] | int = "all"
    seed: int = 0
    device: DeviceName = "auto"
    export: Path | None = None
    dry_run: bool = False
    settings: Annotated[SceneSettings, tyro.conf.arg(name="")] = PRESETS["cpu"]

    @classmethod
    def defaults(cls, words: Sequence[str]) -> "TrainStatic":
        """The verb with the settings of the preset and the strategy that words choose."""
        choice = chosen(SceneChoice, words)
        settings = settings_for(choice.preset, choice.strategy)
        return cls(tyro.MISSING, tyro.MISSING, settings=settings)

    def run(self) -> None:
        """Starts or continues the training; writes the model folder and the exported file."""
        from rich.console import Console

        from ico3d.capture.formats import open_capture
        from ico3d.scene.train_scene import SceneJob, needs_of_scene, train_scene
        from ico3d.splat.files.formats import check_writable, write_gaussians

        if self.export is not None:
            check_writable(self.export)
        job = SceneJob(self.only, self.frames, self.strategy, self.seed, self.settings)
        capture = open_capture(self.capture)
        if self.dry_run:
            print(*needs_of_scene(capture, job, self.device).lines(self.out), sep="\n")
            return
        trained = train_scene(capture, self.out, job, self.device)
        if self.export is not None:
            write_gaussians(self.export, trained.scene.raw())
        seconds = trained.summary["train_seconds"]
        Console().print(f"{self.out}: {len(trained.scene)} Gaussians, trained in {seconds:.0f} s.")
