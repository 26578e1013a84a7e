"""Measures a static scene: the lower bound that every model of a moving person must exceed."""

from pathlib import Path
from typing import Literal

import numpy as np
import torch
from rich.progress import track

from ico3d.capture.capture import Capture
from ico3d.capture.pictures import View
from ico3d.common.psnr import psnr
from ico3d.errors import CaptureError
from ico3d.measure.scores import Scores, add_picture, write_pictures
from ico3d.measure.stopwatch import Stopwatch
from ico3d.scene.model_folder import TrainedScene
from ico3d.scene.views import SceneViews
from ico3d.splat.render import render


def evaluate_scene(
    trained: TrainedScene, capture: Capture, which: Literal["test", "all"], images: Path | None
) -> dict[str, float | str | None]:
    """Picture metrics of a static scene, defined as for heads.

    A person is rendered over the capture's clean plates. `psnr_background` is the PSNR outside of
    the person; for a background without plates it is the only metric.

    Args:
        trained: The scene; it is drawn on its own device.
        capture: The recording to compare with; may differ from that of the training.
        which: `test` for the test views of the capture (`SceneViews.test`), `all` for all views.
        images: Folder for pictures, or None for no pictures.

    Returns:
        Values by metric; None where the capture does not allow the metric.

    Raises:
        CaptureError: If there is no picture to compare with.
    """
    views = SceneViews(capture, trained.only, trained.frames, cache=0)
    chosen = views.test if which == "test" else views.train + views.test
    if not chosen:
        raise CaptureError(
            f"{capture.path} has no test pictures (of fewer than 8, all train): "
            "measure on all with --frames all."
        )
    scores = Scores({name: [] for name in ("psnr", "psnr_mask", "psnr_background", "ssim")})
    renderer = SceneRenderer(trained, views)
    for view in track(chosen, "pictures", transient=True):
        truth, person = (None if part is None else part.numpy() for part in views.layers(view))
        assert truth is not None
        predicted = renderer.picture(view)
        if renderer.shows_all(view, person):
            add_picture(scores, predicted, truth, renderer.watch.device)
        if trained.only != "background" and person is not None:
            measured = capture.head_mask(view.camera_index, view.frame)
            scores.add("psnr_mask", None if measured is None else psnr(predicted, truth, measured))
        if trained.only != "person":
            rest = None if person is None else 1 - person
            scores.add("psnr_background", psnr(predicted, truth, rest))
        if images is not None:
            write_pictures(images, view, predicted, truth, person)
    return scores.means() | {
        "num_gaussians": len(trained.scene),
        **renderer.watch.figures(),
        "train_seconds": trained.summary.get("train_seconds"),
    }


class SceneRenderer:
    """Renders a scene as a capture's cameras would see it."""

    def __init__(self, trained: TrainedScene, views: SceneViews):
        """Takes the scene, and the views of a capture, whose plates are shown behind a person."""
        self._trained, self._views = trained, views
        self.watch = Stopwatch(trained.scene.device)

    @torch.no_grad()
    def picture(self, view: View) -> np.ndarray:
        """(H, W, 3) the rendered view, limited to [0, 1]."""
        behind = self._views.plate(view) if self._trained.only == "person" else None
        if behind is not None:
            behind = behind.to(self._trained.scene.device)
        with self.watch.picture():
            rendering = render(self._trained.scene.gaussians(), [view.camera], behind)
        return rendering.rgb[0].clamp(0, 1).cpu().numpy()

    def shows_all(self, view: View, person: np.ndarray | None) -> bool:
        """Whether the scene accounts for the whole picture.

        A person does so only over a clean plate, a background only in a picture without a person.
        """
        if self._trained.only == "person":
            return self._views.plate(view) is not None
        return self._trained.only == "all" or person is None
