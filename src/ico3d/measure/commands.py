"""The verbs `ico3d evaluate` and `ico3d bench`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro


@dataclass(frozen=True)
class Evaluate:
    """Measures a trained head against a capture, the one it was trained on or another.

    Attributes:
        model: A model folder that ico3d train head wrote.
        capture: The capture with the truth; its sound or blendshapes drive the head.
        json: File for the metrics.
        images: Folder for pictures: {pred,gt,mask}/CAMERA/%06d.png.
        frames: The capture's test frames, or all of them (for a capture that trained nothing).
    """

    model: tyro.conf.Positional[Path]
    capture: tyro.conf.Positional[Path]
    json: Path | None = None
    images: Path | None = None
    frames: Literal["test", "all"] = "test"

    def run(self) -> None:
        """Prints the metrics, writes what was asked for."""
        import json

        from rich.console import Console

        from ico3d.capture.capture import Capture
        from ico3d.common.files import write_atomic
        from ico3d.head.trained import TrainedHead
        from ico3d.measure.evaluate import evaluate_head

        head = TrainedHead.load(self.model)
        capture = Capture.open(self.capture)
        frames = capture.split.test if self.frames == "test" else range(capture.num_frames)
        metrics = evaluate_head(head, capture, frames, self.images)
        if self.json is not None:
            write_atomic(self.json, json.dumps(metrics, indent=1).encode())
        console = Console()
        for name, value in metrics.items():
            console.print(f"{name:16} {'not measured' if value is None else f'{value:.3f}'}")
