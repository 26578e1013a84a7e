"""Motions without networks: still Gaussians, Spacetime Gaussians, and FreeTime."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from torch import Tensor

from ico3d.body.motion.window_model import activated
from ico3d.errors import SettingsError
from ico3d.splat.gaussians import Gaussians


@dataclass(frozen=True)
class Still:
    """A `Motion` of Gaussians that do not move."""

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """No tensors."""
        return ()

    @property
    def shared(self) -> tuple[str, ...]:
        """No tensors."""
        return ()

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """The canonical Gaussians, activated, at any τ."""
        del tau
        return activated(values)

    def about(self) -> dict:
        """Kind of this motion, for `motion_from`."""
        return {"kind": "still"}


MOST_DEGREE = 8
"""Largest degree of a polynomial."""


@dataclass(frozen=True)
class Polynomial:
    """A `Motion` by polynomials: each Gaussian has a time at which it is most opaque.

    With dt = τ − `center`, means are μ + Σ_k `path`_k·dt^k, quaternions q + dt·`turn`, and
    opacities o·exp(−(dt / e^`log_duration`)²).

    Attributes:
        degree: Degree of the polynomial of the means: 3 for Spacetime Gaussians, 1 for FreeTime.
        turning: Whether Gaussians turn, linearly in time.
        detached: Whether means and rotations give no gradient to `center`, as in Spacetime
            Gaussians.
    """

    degree: int
    turning: bool
    detached: bool

    def __post_init__(self):
        """Checks the degree.

        Raises:
            SettingsError: If it is not 1 to `MOST_DEGREE`.
        """
        if not 1 <= self.degree <= MOST_DEGREE:
            raise SettingsError(f"A polynomial's degree must be 1 to {MOST_DEGREE}.")

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """`center` (N,), `log_duration` (N,), `path` (N, degree, 3); `turn` (N, 4) if turning."""
        names = ("center", "log_duration", "path")
        return (*names, "turn") if self.turning else names

    @property
    def shared(self) -> tuple[str, ...]:
        """No tensors."""
        return ()

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """Activated Gaussians at τ in [0, 1]; most of them are nearly transparent at any time."""
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
        """Kind and fields of this motion, for `motion_from`."""
        return {"kind": "polynomial", **asdict(self)}


SPACETIME = Polynomial(degree=3, turning=True, detached=True)
FREETIME = Polynomial(degree=1, turning=False, detached=False)
