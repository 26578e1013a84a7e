"""Gaussians that come, move and go by formulas: Spacetime Gaussians, FreeTime, and still ones."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from torch import Tensor

from ico3d.body.motion.window_model import activated
from ico3d.splat.gaussians import Gaussians


@dataclass(frozen=True)
class Still:
    """A `Motion` without motion."""

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """Nothing."""
        return ()

    @property
    def shared(self) -> tuple[str, ...]:
        """Nothing."""
        return ()

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """The canonical Gaussians."""
        del tau
        return activated(values)

    def about(self) -> dict:
        """Its kind."""
        return {"kind": "still"}


@dataclass(frozen=True)
class Polynomial:
    """A `Motion` by a polynomial about each Gaussian's own time, at which it is most opaque.

    With dt = τ − `center`: μ + Σ_k `path`_k·dt^k, q + dt·`turn`, o·exp(−(dt / e^`log_duration`)²).

    Attributes:
        degree: Of the polynomial: 3 for Spacetime Gaussians, 1 for FreeTime.
        turning: Whether Gaussians turn, at constant speed.
        detached: Whether motion teaches nothing about `center`, as in Spacetime Gaussians.
    """

    degree: int
    turning: bool
    detached: bool

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """`center` (N,), `log_duration` (N,), `path` (N, degree, 3); turning ones `turn` (N, 4)."""
        names = ("center", "log_duration", "path")
        return (*names, "turn") if self.turning else names

    @property
    def shared(self) -> tuple[str, ...]:
        """Nothing."""
        return ()

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """Activated Gaussians; most of them are all but transparent at any one time."""
        since = tau - values["center"]  # (N,)
        visibility = (-(since * (-values["log_duration"]).exp()).square()).exp()  # (N,)
        if self.detached:
            since = since.detach()
        means = values["means"]
        for power in range(self.degree):
            means = means + values["path"][:, power] * since[:, None] ** (power + 1)  # (N, 3)
        turned = values["quats"] + values["turn"] * since[:, None] if self.turning else None
        return activated(values, means, turned, visibility=visibility)

    def about(self) -> dict:
        """Its kind and fields."""
        return {"kind": "polynomial", **asdict(self)}


SPACETIME = Polynomial(degree=3, turning=True, detached=True)
FREETIME = Polynomial(degree=1, turning=False, detached=False)
