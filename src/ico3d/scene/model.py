"""A static scene: Gaussians whose colours depend on the direction of view."""

import math

import numpy as np
import torch
from torch import Tensor

from ico3d.splat import harmonics
from ico3d.splat.files.raw import RawGaussians
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.initial import spacing

NAMES = ("means", "quats", "log_scales", "opacity_logits", "f_dc", "f_rest")


class StaticScene:
    """N Gaussians with the trained parameters, in the layout of 3DGS files.

    Attributes:
        parameters: `means` (N, 3) metres, `quats` (N, 4) wxyz not normalised, `log_scales` (N, 3),
            `opacity_logits` (N,), `f_dc` (N, 1, 3) and `f_rest` (N, (degree + 1)² − 1, 3),
            coefficients of the spherical harmonics. Density control replaces these tensors.
    """

    def __init__(self, parameters: dict[str, Tensor]):
        """Takes all parameters by name.

        Raises:
            ValueError: If a name is missing or unknown, or shapes do not fit one another.
        """
        if set(parameters) != set(NAMES):
            raise ValueError(f"a scene has {', '.join(NAMES)}, not {', '.join(parameters)}")
        count, rest = len(parameters["means"]), parameters["f_rest"].shape[1:2]
        shapes = {"means": (3,), "quats": (4,), "log_scales": (3,), "opacity_logits": ()}
        shapes |= {"f_dc": (1, 3), "f_rest": (*rest, 3)}
        for name, shape in shapes.items():
            if parameters[name].shape != (count, *shape):
                raise ValueError(f"{name} of {count} Gaussians must have shape {(count, *shape)}")
            if parameters[name].dtype != torch.float32:
                raise ValueError(f"{name} must be float32, not {parameters[name].dtype}")
        harmonics.degree_of(1 + rest[0])
        self.parameters = parameters

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self.parameters["means"])

    @property
    def degree(self) -> int:
        """The degree of the spherical harmonics."""
        return harmonics.degree_of(1 + self.parameters["f_rest"].shape[1])

    @property
    def device(self) -> torch.device:
        """The device of the parameters."""
        return self.parameters["means"].device

    def to(self, device: torch.device) -> None:
        """Moves the parameters."""
        self.parameters = {name: value.to(device) for name, value in self.parameters.items()}

    def raw(self) -> RawGaussians:
        """The parameters as files store them, without loss.

        In a scene y points up, in PLY files down. The Gaussians are therefore turned by 180° about
        x, so that other programs show them upright; SPZ files, which turn once more, hold the
        scene's own coordinates.
        """
        arrays = {name: value.detach().cpu().numpy() for name, value in self.parameters.items()}
        return RawGaussians(
            means=arrays["means"],
            dc=arrays["f_dc"][:, 0],  # (N, 3)
            rest=arrays["f_rest"],
            opacities=arrays["opacity_logits"],
            log_scales=arrays["log_scales"],
            quats=arrays["quats"],
        ).half_turn()

    def gaussians(self, degree: int | None = None) -> Gaussians:
        """Renderable Gaussians with harmonics up to `degree`, by default all."""
        values = self.parameters
        used = self.degree if degree is None else min(degree, self.degree)
        rest = values["f_rest"][:, : (used + 1) ** 2 - 1]  # (N, K − 1, 3)
        return Gaussians(
            means=values["means"],
            quats=values["quats"],
            scales=values["log_scales"].exp(),
            opacities=values["opacity_logits"].sigmoid(),
            sh=torch.cat([values["f_dc"], rest], 1) if used else values["f_dc"],  # (N, K, 3)
        )


def scene_on_points(
    points: np.ndarray, colors: np.ndarray, degree: int, opacity: float, scale: float
) -> StaticScene:
    """A scene of round Gaussians at the given points.

    Args:
        points: (N, 3) metres.
        colors: (N, 3) in [0, 1].
        degree: Degree of the spherical harmonics; coefficients above degree 0 start at 0.
        opacity: Initial opacity of all Gaussians, 0 to 1.
        scale: Size of a Gaussian as a factor of its distance to its neighbours.
    """
    count = len(points)
    sizes = torch.from_numpy(np.log(spacing(points) * scale)).float()
    base = (torch.from_numpy(colors).float() - 0.5) / harmonics.C0  # (N, 3)
    return StaticScene(
        {
            "means": torch.from_numpy(points).float(),
            "quats": torch.tensor([1.0, 0, 0, 0]).repeat(count, 1),
            "log_scales": sizes[:, None].repeat(1, 3),  # (N, 3)
            "opacity_logits": torch.full((count,), math.log(opacity / (1 - opacity))),
            "f_dc": base[:, None],  # (N, 1, 3)
            "f_rest": torch.zeros(count, (degree + 1) ** 2 - 1, 3),
        }
    )
