"""The verb `ico3d train head`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ico3d.common.device import DeviceName


@dataclass(frozen=True)
class TrainHead:
    """Trains HeadGaS++ on a capture. The same command goes on where it was interrupted.

    Attributes:
        capture: A capture folder with head poses.
        out: The model folder to write.
        inputs: What drives the head: its own speech, or the capture's blendshapes.
        variant: The paper's model, or what it is compared with: colours and opacity blended
            directly, the expression fed to the MLP instead of blended, no expression at all.
        preset: Settings of the paper, or sized for two CPU cores.
        set: Changes to the preset, as name=value (names: ico3d.head.settings.HeadSettings).
        encoder: Speech encoder for speech-driven heads: builtin, ave (SyncTalk's) or hubert.
        seed: All randomness follows from it.
        device: Where to compute: by default with CUDA where that works, else on the CPU.
        watch: Shows the training in the browser while it lasts.
        watch_port: Where, on this machine only; the next free port where it is taken.
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    inputs: Literal["speech", "blendshapes"] = "speech"
    variant: Literal["full", "no-mlp", "no-blending", "static"] = "full"
    preset: Literal["cpu", "paper"] = "cpu"
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    encoder: str = "builtin"
    seed: int = 0
    device: DeviceName = "auto"
    watch: bool = False
    watch_port: int = 8080

    def run(self) -> None:
        """Trains, or goes on training; writes the model folder."""
        from rich.console import Console

        from ico3d.capture.formats import open_capture
        from ico3d.head.settings import PRESETS
        from ico3d.head.train_head import HeadJob, train_head

        settings = PRESETS[self.preset].with_changes(self.set)
        job = HeadJob(self.inputs, self.variant, self.encoder, self.seed, settings)
        port = self.watch_port if self.watch else None
        head = train_head(open_capture(self.capture), self.out, job, port, self.device)
        seconds = head.summary["train_seconds"]
        Console().print(f"{self.out}: {len(head.model)} Gaussians, trained in {seconds:.0f} s.")
