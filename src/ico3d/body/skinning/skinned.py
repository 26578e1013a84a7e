"""Gaussians on a skeleton: one set of Gaussians for the whole clip, posed in each frame."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import torch
from torch import Tensor
from torch.nn.functional import normalize

from ico3d.body.motion.window_model import activated
from ico3d.body.skinning import coefficients
from ico3d.body.skinning.blending import Posed, blended
from ico3d.body.skinning.kinematics import transforms
from ico3d.body.skinning.light import lamp_lit, lit
from ico3d.body.skinning.shadow import posed_casters, reached
from ico3d.errors import SettingsError
from ico3d.rig import quaternions
from ico3d.splat.gaussians import Gaussians

NETWORK = "coefficients."
"""Prefix of the names of the tensors of the network that gives coefficients."""
LAMP = ("lamp_direction", "lamp_strength")
"""Tensors of the lamp."""
CASTERS = ("caster_points", "caster_joints", "caster_weights")
"""Tensors of the spheres that cast shadows."""
PER_FRAME = ("pose_rotations", "pose_roots")
"""Tensors with one row per frame: a picture gives a gradient to one row only."""
ON_FRAME = 1e-3
"""Tolerance in frames within which a time counts as a whole frame."""


@dataclass(frozen=True)
class Pose:
    """A pose of the skeleton, with coefficients of the residual shapes.

    Attributes:
        rotations: (J, 4) local rotation of each joint, wxyz.
        root: (3,) translation of the root from rest, metres.
        residual: (K,) coefficients of the residual shapes; None to draw without them.
    """

    rotations: Tensor
    root: Tensor
    residual: Tensor | None


@dataclass(frozen=True)
class Skinned:
    """A `Motion`: linear blend skinning of canonical Gaussians, with residual shapes and light.

    The mean of a posed Gaussian is x = Σ_j w_j (R_j (μ + Σ_k κ_k Δμ_k − joint_j) + place_j), with
    the weight w_j, rotation R_j, rest position joint_j and posed position place_j of joint j, and
    the pose's coefficient κ_k of residual shape k. Its rotation is the blended quaternion of the
    joints times the Gaussian's own. Its colour logits are those of the canonical Gaussian, plus
    Σ_k κ_k Δc_k, plus the light's spherical harmonics at the posed normal, plus what a
    lamp adds where no part of the body stands before it.

    Attributes:
        names: Names of the J joints.
        parents: Index of each joint's parent, −1 for joint 0.
        frames: Number of frames of the window; each has a trained pose.
        shapes: Number K of residual shapes; 0 for none.
        hidden: Width of the hidden layer of the network that gives their coefficients.
        light: Whether colours depend on the direction in which the posed surface faces.
        shadow: Whether a lamp lights the body, which casts a shadow on itself; only with `light`.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    frames: int
    shapes: int
    hidden: int
    light: bool
    shadow: bool = False

    def __post_init__(self):
        """Checks the numbers.

        Raises:
            SettingsError: If there are no frames, fewer than 0 shapes, or a network without values.
        """
        if self.frames < 1 or self.shapes < 0 or self.hidden < min(self.shapes, 1):
            raise SettingsError(
                f"A motion of {self.frames} frames, {self.shapes} shapes and a hidden layer of "
                f"{self.hidden} values does not exist."
            )

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """Names of the tensors of the Gaussians beside `CANONICAL`.

        They are `skin_joints` (N, 4) int32 and `skin_logits` (N, 4), whose softmax gives weights;
        with light `normals` (N, 3) at rest; with residual shapes `shape_means` (N, 3, K), metres in
        rest space, and `shape_colors` (N, 3, K), logits.
        """
        names = ("skin_joints", "skin_logits")
        names += ("normals",) if self.light else ()
        return (*names, "shape_means", "shape_colors") if self.shapes else names

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of the tensors that all Gaussians share.

        They are `rig_joints` (J, 3) metres at rest; `pose_rotations` (F, J, 4) wxyz and
        `pose_roots` (F, 3) metres of the frames; with light `light` (8, 3); with residual shapes
        the tensors of the network that gives their coefficients. With a shadow `lamp_direction`
        (3,), a unit vector, and `lamp_strength` (3,), logarithms; and the spheres that cast it:
        `caster_points` (M, 3) metres at rest, `caster_joints` (M, 4) int32 and `caster_weights`
        (M, 4).
        """
        names = ("rig_joints", "pose_rotations", "pose_roots")
        names += ("light",) if self.light else ()
        names += (*LAMP, *CASTERS) if self.shadow else ()
        layers = coefficients.LAYERS if self.shapes else ()
        return (*names, *(NETWORK + layer for layer in layers))

    @property
    def fixed(self) -> tuple[str, ...]:
        """Names of the tensors that are not trained.

        Learning the weights gains nothing where those of the template are good (docs/choices.md).
        """
        return ("skin_joints", "skin_logits", "normals", "lamp_direction", *CASTERS)

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """Activated Gaussians in the world at τ; between two frames in an interpolated pose."""
        return self.drawn(values, self.pose_at(values, tau))

    def pose_at(self, values: Mapping[str, Tensor], tau: float) -> Pose:
        """The trained pose at τ; an interpolated pose between two frames has no gradients."""
        at = tau * (self.frames - 1)
        frame = min(max(round(at), 0), self.frames - 1)
        if abs(at - frame) < ON_FRAME or self.frames == 1:
            return self._frame(values, frame)
        first = min(max(int(at), 0), self.frames - 2)
        with torch.no_grad():
            return _between(self._frame(values, first), self._frame(values, first + 1), at - first)

    def posed(self, values: Mapping[str, Tensor], rotations: Tensor, root: Tensor) -> Gaussians:
        """Activated Gaussians in the world, in any pose, which gets no gradient by its shapes.

        Args:
            values: The tensors of `CANONICAL` and of this motion, by name.
            rotations: (J, 4) local rotation of each joint, wxyz.
            root: (3,) translation of the root from rest, metres.
        """
        residual = None
        if self.shapes:
            with torch.no_grad():  # a pose shall not follow what the shapes could make of it
                known = values["pose_rotations"]
                mixed = coefficients.network(self._network(values), known)  # (F, K)
                residual = coefficients.interpolated(known, mixed, rotations)
        return self.drawn(values, Pose(rotations, root, residual))

    def drawn(self, values: Mapping[str, Tensor], pose: Pose) -> Gaussians:
        """Activated Gaussians in the world, in a pose with given coefficients of the shapes."""
        means, colors = values["means"], values["color_logits"]
        if pose.residual is not None:
            means = means + values["shape_means"] @ pose.residual  # (N, 3)
            colors = colors + values["shape_colors"] @ pose.residual  # (N, 3)
        table, posed = self._hung(values, means, pose)
        logits = {"color_logits": colors + self._light(values, table, posed)}
        return activated({**values, **logits}, posed.means, posed.quats)

    def about(self) -> dict:
        """Kind and fields of this motion, for `motion_from`."""
        return {"kind": "skinned", **asdict(self)}

    def _frame(self, values: Mapping[str, Tensor], frame: int) -> Pose:
        rotations = values["pose_rotations"][frame]  # (J, 4)
        residual = None
        if self.shapes:
            # Detached: poses are to be learnt from where the body is seen, not from its colours.
            residual = coefficients.network(self._network(values), rotations.detach())  # (K,)
        return Pose(rotations, values["pose_roots"][frame], residual)

    def _network(self, values: Mapping[str, Tensor]) -> dict[str, Tensor]:
        return {layer: values[NETWORK + layer] for layer in coefficients.LAYERS}

    def lighting(self, values: Mapping[str, Tensor], pose: Pose) -> Tensor:
        """(N, 3) what light adds to colour logits in a pose; zeros without light."""
        table, posed = self._hung(values, values["means"], pose)
        return self._light(values, table, posed)

    def _hung(
        self, values: Mapping[str, Tensor], means: Tensor, pose: Pose
    ) -> tuple[Tensor, Posed]:
        """Transforms (J, 16) of the joints, and Gaussians with means (N, 3) at rest on them."""
        table = transforms(self.parents, values["rig_joints"], pose.rotations, pose.root)
        normals = values["normals"] if self.light else torch.zeros_like(means)
        hung = (values["skin_joints"], values["skin_logits"])
        return table, blended(table, *hung, means, values["quats"], normals)

    def _light(self, values: Mapping[str, Tensor], table: Tensor, posed: Posed) -> Tensor:
        """(N, 3) what light adds to colour logits of Gaussians as they lie and face."""
        if not self.light:
            return torch.zeros_like(posed.means)
        normals = normalize(posed.normals, dim=1)  # (N, 3)
        around = lit(normals, values["light"])
        if not self.shadow:
            return around
        casters = posed_casters(table.detach(), *(values[name] for name in CASTERS))
        direction, strength = (values[name] for name in LAMP)
        reach = reached(posed.means, normals, casters, direction)  # (N,)
        return around + lamp_lit(normals, reach, direction, strength)


def without_residual(pose: Pose) -> Pose:
    """The same pose without residual shapes, and detached: it does not learn to replace them."""
    return replace(pose, rotations=pose.rotations.detach(), root=pose.root.detach(), residual=None)


def _between(a: Pose, b: Pose, part: float) -> Pose:
    """A pose between a (part 0) and b (part 1): slerp of rotations on the shorter way."""
    one, other = (quaternions.normalized(p.rotations.double().cpu().numpy()) for p in (a, b))
    turned = torch.from_numpy(quaternions.slerp(one, other, part)).to(a.rotations)  # (J, 4)
    residual = None
    if a.residual is not None and b.residual is not None:
        residual = torch.lerp(a.residual, b.residual, part)
    return Pose(turned, torch.lerp(a.root, b.root, part), residual)
