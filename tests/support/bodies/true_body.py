"""A body that is what `MovingCapture` shows, or off by a known amount."""

from pathlib import Path

import torch

from ico3d.body.model_folder import ABOUT, TrainedBody, save_window
from ico3d.body.motion.formulas import Still
from ico3d.body.motion.window_model import WindowModel, activated
from ico3d.body.planning.windows import Window
from support.bodies.moving_capture import POINTS, MovingCapture

WINDOWS = (Window(0, 4), Window(4, 8))


class Known:
    """Puts Gaussians to their places in each frame of a window, and lightens them."""

    per_gaussian, shared = (), ()

    def __init__(self, places, lighter):
        self._places, self._lighter = places, lighter

    def at(self, values, tau):
        place = self._places[round(tau * (len(self._places) - 1))]
        gaussians = activated(values, means=torch.from_numpy(place).float())
        gaussians.colors = gaussians.colors + self._lighter
        return gaussians

    def about(self):
        return {}


def _values(capture: MovingCapture) -> dict[str, torch.Tensor]:
    return {
        "means": torch.zeros(POINTS, 3),
        "quats": torch.tensor([1.0, 0, 0, 0]).repeat(POINTS, 1),
        "log_scales": torch.full((POINTS, 3), 0.022).log(),
        "opacity_logits": torch.full((POINTS,), 0.9).logit(),
        "color_logits": torch.from_numpy(capture._colors).float().logit(),
    }


def true_body(capture: MovingCapture, lighter=(0.0, 0.0)) -> TrainedBody:
    """A body whose windows are lighter than the truth by so much."""
    models = []
    for window, extra in zip(WINDOWS, lighter, strict=True):
        places = [capture.world_points(frame) for frame in range(window.first, window.last + 1)]
        models.append(WindowModel(Known(places, extra), _values(capture), {}))
    return TrainedBody(models, WINDOWS, capture.fps, "swings++", {"train_seconds": 7.0})


def still_body(capture: MovingCapture, folder: Path, about=ABOUT, frame=0) -> TrainedBody:
    """A saved body that stands as it does at one frame."""
    values = _values(capture) | {"means": torch.from_numpy(capture.world_points(frame)).float()}
    model = WindowModel(Still(), values, {})
    files = [f"{about}-{number}.safetensors" for number in range(len(WINDOWS))]
    for file in files:
        save_window(folder / file, model)
    body = TrainedBody([model, model], WINDOWS, capture.fps, "static", {"train_seconds": 7.0})
    body.save(folder, files, about)
    return body
