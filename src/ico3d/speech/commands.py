"""The verbs `ico3d train speech` and `ico3d weights onnx`."""

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TextIO

import tyro

from ico3d.common.files import read_small, write_atomic
from ico3d.speech.training.settings import EncoderSettings

if TYPE_CHECKING:
    from ico3d.speech.training.corpus import Batch
    from ico3d.speech.training.train_encoder import EncoderTraining


@dataclass(frozen=True)
class TrainSpeech:
    """Trains the built-in speech encoder on espeak-ng voices and measures it on held-out ones.

    The training data are synthesised, so no recordings are needed. The same command continues an
    interrupted training.

    Attributes:
        out: Folder for encoder.safetensors, encoder.json (settings and measured quality) and
            metrics.jsonl.
        test_batches: Number of batches of held-out voices, languages and words for the measurement.
        settings: How the encoder is trained.
    """

    out: tyro.conf.Positional[Path]
    test_batches: int = 32
    settings: Annotated[EncoderSettings, tyro.conf.arg(name="")] = field(
        default_factory=EncoderSettings
    )

    def run(self) -> None:
        """Trains, measures, and writes the folder."""
        from rich import print as show

        from ico3d.speech.training.train_encoder import EncoderTraining, evaluate, save_encoder

        self.out.mkdir(parents=True, exist_ok=True)
        training = EncoderTraining(self.settings, self.out / "checkpoint.pt")
        self._train(training)
        network, readout = training.finished()
        measured = evaluate(network, readout, self._held_out())
        save_encoder(self.out, network, readout, self._card(measured))
        show(measured)

    def _train(self, training: "EncoderTraining") -> None:
        """Runs the optimisation under a progress bar, with a line of metrics per step."""
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
        from rich.progress import TimeRemainingColumn as Remaining

        columns = (BarColumn(), MofNCompleteColumn(), Remaining(), TextColumn("{task.description}"))
        with Progress(*columns) as bar, self._metrics(training.step) as metrics:
            task = bar.add_task("", total=self.settings.steps)
            for numbers in training.run():
                metrics.write(json.dumps({"step": training.step, **numbers}) + "\n")
                metrics.flush()
                text = " ".join(f"{name} {value:.3f}" for name, value in numbers.items())
                bar.update(task, completed=training.step + 1, description=text)

    def _metrics(self, step: int) -> TextIO:
        """metrics.jsonl, without what an interrupted run wrote after its last checkpoint."""
        path = self.out / "metrics.jsonl"
        lines = read_small(path).splitlines(keepends=True) if os.path.exists(path) else []
        write_atomic(path, b"".join(lines[:step]))  # a link there is replaced, not followed
        return path.open("a")

    def _held_out(self) -> "list[Batch]":
        """Batches that no training sees."""
        import numpy as np

        from ico3d.speech.training.corpus import make_batch

        random = np.random.default_rng([self.settings.seed, 2**32 - 1])
        size, seconds = self.settings.batch, self.settings.seconds
        return [make_batch(random, size, seconds, held_out=True) for _ in range(self.test_batches)]

    def _card(self, measured: dict) -> dict:
        """What encoder.json tells."""
        from ico3d.speech.training.corpus import (
            HELD_OUT_LANGUAGES,
            HELD_OUT_VARIANTS,
            LANGUAGES,
            VARIANTS,
        )

        hours = self.settings.steps * self.settings.batch * self.settings.seconds / 3600
        return {
            "made_by": "ico3d train speech",
            "settings": asdict(self.settings),
            "data": "random words read by espeak-ng, with simulated voices, rooms and noise",
            "hours_of_sound": round(hours, 1),
            "languages": sorted(set(LANGUAGES)),
            "voices": len(VARIANTS),
            "held_out": {
                "languages": list(HELD_OUT_LANGUAGES),
                "voices": list(HELD_OUT_VARIANTS),
                "words": "every eighth of words.txt",
                "seconds": self.test_batches * self.settings.batch * self.settings.seconds,
                **measured,
            },
        }


@dataclass(frozen=True)
class ExportEncoder:
    """Exports a speech encoder to ONNX for servers of avatars, which have no torch.

    Baking a head exports its encoder, too. A server on another machine needs a copy of the file.

    Attributes:
        name: ave or hubert; the weights must be installed (ico3d weights fetch).
    """

    name: tyro.conf.Positional[Literal["ave", "hubert"]]

    def run(self) -> None:
        """Writes the ONNX file and prints its path."""
        from rich.console import Console

        from ico3d.speech.encoder import load_encoder
        from ico3d.speech.export import make_servable

        path = make_servable(load_encoder(self.name))
        Console().print(f"{self.name} is servable here: {path}", soft_wrap=True)
