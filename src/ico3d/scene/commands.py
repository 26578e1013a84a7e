"""The verb `ico3d train static`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ico3d.common.device import DeviceName


@dataclass(frozen=True)
class TrainStatic:
    """Trains a static scene (3D Gaussian splatting): a background, or a person who stands still.

    The same command goes on where it was interrupted.

    Attributes:
        capture: A capture folder.
        out: The model folder to write.
        only: The whole picture; the person cut out, which takes masks; or everything but the
            person.
        frames: All frames together, or the number of the one moment to show.
        strategy: How Gaussians multiply: 3DGS's own way, or as a Markov chain.
        preset: Settings of 3DGS, or sized for two CPU cores.
        set: Changes to the preset, as name=value (names: ico3d.scene.settings.SceneSettings).
        seed: All randomness follows from it.
        device: Where to compute: by default with CUDA where that works, else on the CPU.
        export: A file for other tools: .ply (lossless) or .spz (small; for scenes of avatars).
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    only: Literal["all", "person", "background"] = "all"
    frames: Literal["all"] | int = "all"
    strategy: Literal["default", "mcmc"] = "default"
    preset: Literal["cpu", "paper"] = "cpu"
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    seed: int = 0
    device: DeviceName = "auto"
    export: Path | None = None

    def run(self) -> None:
        """Trains, or goes on training; writes the model folder and what is exported."""
        from rich.console import Console

        from ico3d.capture.formats import open_capture
        from ico3d.scene.settings import PRESETS
        from ico3d.scene.train_scene import SceneJob, train_scene
        from ico3d.splat.files.formats import check_writable, write_gaussians
        from ico3d.training.changes import with_changes

        if self.export is not None:
            check_writable(self.export)
        settings = with_changes(PRESETS[self.preset, self.strategy], self.set)
        job = SceneJob(self.only, self.frames, self.strategy, self.seed, settings)
        trained = train_scene(open_capture(self.capture), self.out, job, self.device)
        if self.export is not None:
            write_gaussians(self.export, trained.scene.raw())
        seconds = trained.summary["train_seconds"]
        Console().print(f"{self.out}: {len(trained.scene)} Gaussians, trained in {seconds:.0f} s.")
