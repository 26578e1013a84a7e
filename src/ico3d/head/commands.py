"""The verb `ico3d train head`."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ico3d.common.device import DeviceName
from ico3d.common.presets import PresetName, chosen
from ico3d.head.settings import PRESETS, HeadSettings


@dataclass(frozen=True, kw_only=True)
class HeadChoice:
    """The options that decide the defaults of all others.

    Attributes:
        preset: The paper's settings, or those sized for two CPU cores;
            the defaults shown here are those of the preset that is chosen.
    """

    preset: PresetName = "cpu"


@dataclass(frozen=True)
class TrainHead(HeadChoice):
    """Trains HeadGaS++ on a capture. The same command continues an interrupted training.

    Attributes:
        capture: A capture folder with head poses.
        out: The model folder to write.
        inputs: What drives the head: its own speech, or the capture's blendshapes.
        variant: The paper's model, or one to compare with: colours and opacity blended directly,
            the expression given to the MLP instead of blended, or no expression at all.
        encoder: Speech encoder for speech-driven heads: builtin, ave (SyncTalk's) or hubert.
        seed: Seed of all random numbers.
        hold_out: Leave out the validation pictures, too, for ico3d evaluate --frames validation.
        over_torso: Learn the head of a portrait alone, over the recorded torso of each frame, as
            papers compare it; such a head has no shoulders of its own.
        device: Where to compute: by default CUDA where that works, else the CPU.
        watch: Show the training in the browser while it lasts.
        watch_port: Port of that page, on this machine only; if it is taken, the next free one.
        dry_run: Only say how much time, memory and disk the training takes; a few of its steps are
            done, and nothing is written.
        settings: How the head is trained.
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    inputs: Literal["speech", "blendshapes"] = "speech"
    variant: Literal["full", "no-mlp", "no-blending", "static"] = "full"
    encoder: str = "builtin"
    seed: int = 0
    hold_out: bool = False
    over_torso: bool = False
    device: DeviceName = "auto"
    watch: bool = False
    watch_port: int = 8080
    dry_run: bool = False
    settings: Annotated[HeadSettings, tyro.conf.arg(name="")] = PRESETS["cpu"]

    @classmethod
    def defaults(cls, words: Sequence[str]) -> "TrainHead":
        """The verb with the settings of the preset that `words` of the command line choose."""
        preset = chosen(HeadChoice, words).preset
        return cls(tyro.MISSING, tyro.MISSING, settings=PRESETS[preset])

    def run(self) -> None:
        """Starts or continues the training; writes the model folder."""
        from rich.console import Console

        from ico3d.capture.formats import open_capture
        from ico3d.head.train_head import HeadJob, needs_of_head, train_head
        from ico3d.head.watch import live_page

        given = (self.inputs, self.variant, self.encoder, self.seed, self.settings)
        job = HeadJob(*given, self.hold_out, self.over_torso)
        watched = partial(live_page, port=self.watch_port) if self.watch else None
        capture = open_capture(self.capture)
        if self.dry_run:
            print(*needs_of_head(capture, job, self.device).lines(self.out), sep="\n")
            return
        head = train_head(capture, self.out, job, watched, self.device)
        seconds = head.summary["train_seconds"]
        Console().print(f"{self.out}: {len(head.model)} Gaussians, trained in {seconds:.0f} s.")
