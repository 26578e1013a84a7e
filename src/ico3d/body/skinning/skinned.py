"""Gaussians on a skeleton: one set for the whole clip, posed frame by frame."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import torch
from torch import Tensor
from torch.nn.functional import normalize

from ico3d.body.motion.window_model import activated
from ico3d.body.skinning import coefficients
from ico3d.body.skinning.blending import blended
from ico3d.body.skinning.kinematics import transforms
from ico3d.body.skinning.light import lit
from ico3d.rig import quaternions
from ico3d.splat.gaussians import Gaussians

NETWORK = "coefficients."
"""What the names of the network's tensors begin with."""
PER_FRAME = ("pose_rotations", "pose_roots")
"""Tensors of which a picture teaches one row."""
ON_FRAME = 1e-3
"""Part of a frame by which a time may miss it."""


@dataclass(frozen=True)
class Pose:
    """A pose as it is drawn.

    Attributes:
        rotations: (J, 4) wxyz of each joint about itself.
        root: (3,) metres that the root moves from rest.
        residual: (K,) coefficients of the residual shapes; None without them.
    """

    rotations: Tensor
    root: Tensor
    residual: Tensor | None


@dataclass(frozen=True)
class Skinned:
    """A `Motion`: linear blend skinning of canonical Gaussians, with residual shapes and light.

    x = Σ_j w_j (R_j (μ + Σ_k κ_k Δμ_k − joint_j) + place_j); the rotation is the blended
    quaternion of the joints times the Gaussian's own; colour logits get Σ_k κ_k Δc_k and the
    light's spherical harmonics at the posed normal.

    Attributes:
        names: J joints.
        parents: J numbers, −1 for joint 0.
        frames: Frames of the window, which have a trained pose each.
        shapes: K residual shapes; 0 for none.
        hidden: Width of the network that gives their coefficients.
        light: Whether colour depends on where the posed surface faces.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    frames: int
    shapes: int
    hidden: int
    light: bool

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """Joints and weights; where there is light or a residual, what these need.

        `skin_joints` (N, 4) int32 and `skin_logits` (N, 4), whose softmax is the weights; `normals`
        (N, 3) at rest; `shape_means` (N, 3, K) metres in rest space and `shape_colors` (N, 3, K).
        """
        names = ("skin_joints", "skin_logits")
        names += ("normals",) if self.light else ()
        return (*names, "shape_means", "shape_colors") if self.shapes else names

    @property
    def shared(self) -> tuple[str, ...]:
        """`rig_joints` (J, 3), `pose_rotations` (F, J, 4), `pose_roots` (F, 3), `light` (8, 3)."""
        names = ("rig_joints", "pose_rotations", "pose_roots")
        names += ("light",) if self.light else ()
        layers = coefficients.LAYERS if self.shapes else ()
        return (*names, *(NETWORK + layer for layer in layers))

    @property
    def fixed(self) -> tuple[str, ...]:
        """Names of the tensors that training leaves as they are.

        Weights that are learnt gain nothing where the template's are good (docs/choices.md).
        """
        return ("skin_joints", "skin_logits", "normals")

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """Activated Gaussians at τ; between two frames in a pose between theirs."""
        return self.drawn(values, self.pose_at(values, tau))

    def pose_at(self, values: Mapping[str, Tensor], tau: float) -> Pose:
        """The trained pose at τ; only that of a frame has gradients."""
        at = tau * (self.frames - 1)
        frame = min(max(round(at), 0), self.frames - 1)
        if abs(at - frame) < ON_FRAME or self.frames == 1:
            return self._frame(values, frame)
        first = min(max(int(at), 0), self.frames - 2)
        with torch.no_grad():
            return _between(self._frame(values, first), self._frame(values, first + 1), at - first)

    def posed(self, values: Mapping[str, Tensor], rotations: Tensor, root: Tensor) -> Gaussians:
        """Activated Gaussians in any pose.

        Args:
            values: As for `at`.
            rotations: (J, 4) wxyz of each joint about itself.
            root: (3,) metres that the root moves from rest.
        """
        residual = None
        if self.shapes:
            known = values["pose_rotations"]
            mixed = coefficients.network(self._network(values), known)  # (F, K)
            residual = coefficients.interpolated(known, mixed, rotations)
        return self.drawn(values, Pose(rotations, root, residual))

    def drawn(self, values: Mapping[str, Tensor], pose: Pose) -> Gaussians:
        """Activated Gaussians in a pose with the coefficients that it says."""
        table = transforms(self.parents, values["rig_joints"], pose.rotations, pose.root)
        means = values["means"]
        if pose.residual is not None:
            means = means + values["shape_means"] @ pose.residual  # (N, 3)
        normals = values["normals"] if self.light else torch.zeros_like(means)
        hung = (values["skin_joints"], values["skin_logits"])
        posed = blended(table, *hung, means, values["quats"], normals)
        colors = {"color_logits": self._colors(values, posed.normals, pose)}
        return activated({**values, **colors}, posed.means, posed.quats)

    def about(self) -> dict:
        """Its kind and fields."""
        return {"kind": "skinned", **asdict(self)}

    def _frame(self, values: Mapping[str, Tensor], frame: int) -> Pose:
        rotations = values["pose_rotations"][frame]  # (J, 4)
        residual = None
        if self.shapes:
            # The pose shall follow what is seen where, not what the network could use.
            residual = coefficients.network(self._network(values), rotations.detach())  # (K,)
        return Pose(rotations, values["pose_roots"][frame], residual)

    def _network(self, values: Mapping[str, Tensor]) -> dict[str, Tensor]:
        return {layer: values[NETWORK + layer] for layer in coefficients.LAYERS}

    def _colors(self, values: Mapping[str, Tensor], normals: Tensor, pose: Pose) -> Tensor:
        """(N, 3) logits of a surface that faces along normals (N, 3) of any length."""
        colors = values["color_logits"]
        if self.light:
            colors = colors + lit(normalize(normals, dim=1), values["light"])
        if pose.residual is not None:
            colors = colors + values["shape_colors"] @ pose.residual  # (N, 3)
        return colors


def without_residual(pose: Pose) -> Pose:
    """The same pose with all coefficients 0; it does not learn to make up for them."""
    return replace(pose, rotations=pose.rotations.detach(), root=pose.root.detach(), residual=None)


def _between(a: Pose, b: Pose, part: float) -> Pose:
    """A pose between two, part 0 to 1: joints turn on the shorter way."""
    one, other = (quaternions.normalized(p.rotations.double().cpu().numpy()) for p in (a, b))
    turned = torch.from_numpy(quaternions.slerp(one, other, part)).to(a.rotations)  # (J, 4)
    residual = None
    if a.residual is not None and b.residual is not None:
        residual = torch.lerp(a.residual, b.residual, part)
    return Pose(turned, torch.lerp(a.root, b.root, part), residual)
