"""Collects scores of pictures, and writes pictures so that other programs can score them."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from ico3d.capture.decoding import to_bytes
from ico3d.capture.pictures import View
from ico3d.common.files import write_one_of_many
from ico3d.common.psnr import psnr
from ico3d.measure.pictures.lpips import lpips
from ico3d.measure.pictures.ms_ssim import ms_ssim
from ico3d.splat.device import CPU
from ico3d.splat.losses import ssim

PICTURE = ("psnr", "ssim", "ms_ssim", "lpips", "lpips_alex")
"""Metrics of a whole picture, as `add_picture` names them."""


@dataclass
class Scores:
    """Values of metrics over several pictures; None values are left out."""

    values: dict[str, list[float]] = field(default_factory=dict)

    def add(self, name: str, value: float | None) -> None:
        """Adds the value of one picture."""
        self.values.setdefault(name, [])
        if value is not None:
            self.values[name].append(value)

    def means(self) -> dict[str, float | None]:
        """Mean of each metric, None if no picture had a value."""
        return {name: float(np.mean(v)) if v else None for name, v in self.values.items()}


def add_picture(
    scores: Scores, predicted: np.ndarray, truth: np.ndarray, device: torch.device = CPU
) -> None:
    """Adds the metrics `PICTURE` of one whole picture.

    Args:
        scores: Receives the values.
        predicted: (H, W, 3) in [0, 1].
        truth: (H, W, 3) in [0, 1].
        device: Device for the networks of LPIPS and for MS-SSIM.
    """
    scores.add("psnr", psnr(predicted, truth))
    scores.add("ssim", float(ssim(torch.from_numpy(predicted), torch.from_numpy(truth))))
    scores.add("ms_ssim", ms_ssim(predicted, truth, device))
    scores.add("lpips", lpips(predicted, truth, "vgg", device))
    scores.add("lpips_alex", lpips(predicted, truth, "alex", device))


def write_pictures(
    folder: Path, view: View, predicted: np.ndarray, truth: np.ndarray, mask: np.ndarray | None
) -> None:
    """Writes a view's pictures as `FOLDER/{pred,gt,mask}/CAMERA/%06d.png`."""
    for part, picture in {"pred": predicted, "gt": truth, "mask": mask}.items():
        if picture is None:
            continue
        path = folder / part / view.camera.name / f"{view.frame:06d}.png"
        write_one_of_many(path, Image.fromarray(to_bytes(picture)).save)
