"""HeadGaS++: Gaussians whose colour and opacity follow an expression (paper, head model)."""

import json
import math
from dataclasses import KW_ONLY, asdict, dataclass, replace
from pathlib import Path
from typing import Literal

import torch
from torch import Tensor, nn

from ico3d.common.expression import LEAKY_SLOPE, MOST_DISPLACEMENTS, MOVE_HIDDEN, TURN_SIZE
from ico3d.errors import ModelError, SettingsError
from ico3d.head.blending import decoder
from ico3d.head.blending.basis import blend
from ico3d.head.portrait.neck import Neck
from ico3d.splat import harmonics
from ico3d.splat.gaussians import Gaussians
from ico3d.training.checkpoint import (
    DAMAGED,
    check_places,
    check_shapes,
    check_width,
    load_tensors,
    save_tensors,
)
from ico3d.training.finite import all_finite

Variant = Literal["full", "no-mlp", "no-blending", "static"]

INITIAL_OPACITY = 0.1
MOVE_NETWORK = ("move_w1", "move_b1", "move_w2", "move_b2")
MOST = 8192
"""Largest size of an expression, of the MLP and of what it reads."""


@dataclass(frozen=True)
class HeadShape:
    """Everything that decides the sizes of a head model's parameters.

    Attributes:
        expression_size: B, number of values of an expression.
        variant: `full` is the paper's model; `no-mlp` blends colours and opacity directly;
            `no-blending` gives the expression to the MLP instead of blending; `static` ignores the
            expression.
        features: f, width of the latent basis per Gaussian.
        hidden: Width of the MLP's hidden layers.
        frequencies: L, octaves of the position encoding.
        box_center: Centre of the head's bounding box in metres; encoded positions are relative to
            it.
        box_size: Half of the box's longest edge in metres.
        sh_degree: Degree of the spherical harmonics by which colours depend on the direction of
            view; 0 for colours that do not.
        turns: Whether the basis has rows for the head's rotation, too, by which its shading
            follows lamps that stand still (`TurnRange`).
        relit: Whether each Gaussian has a change of light (`HeadModel.relit`).
        neck: Where a portrait's neck bends; None where all Gaussians follow the head.
        displacements: M, number of ways in which Gaussians move with the expression; 0 for
            Gaussians that stand still, as in the paper.
    """

    expression_size: int
    variant: Variant = "full"
    _: KW_ONLY
    features: int
    hidden: int
    frequencies: int
    box_center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    box_size: float = 1.0
    sh_degree: int = 0
    turns: bool = False
    relit: bool = False
    neck: Neck | None = None
    displacements: int = 0

    def __post_init__(self):
        """Checks the sizes, of which a file of a few bytes can name any.

        Raises:
            SettingsError: If one is below its least or above `MOST`.
        """
        sizes = {"expression_size": 0, "features": 1, "hidden": 1}
        for name, fewest in (sizes | {"frequencies": 0, "displacements": 0}).items():
            value = getattr(self, name)
            most = MOST_DISPLACEMENTS if name == "displacements" else MOST
            if type(value) is not int or not fewest <= value <= most:
                raise SettingsError(f"A head's {name} is {fewest} to {most:,}, not {value!r:.40}.")

    @property
    def outputs(self) -> int:
        """V, values of a Gaussian: logits of r, g, b and opacity, harmonics above degree 0."""
        return 4 + 3 * ((self.sh_degree + 1) ** 2 - 1)

    @property
    def blends(self) -> bool:
        """Whether the variant blends rows of the basis by the expression."""
        return self.variant in ("full", "no-mlp")

    @property
    def has_mlp(self) -> bool:
        """Whether the variant has an MLP from features to colour and opacity."""
        return self.variant in ("full", "no-blending")

    @property
    def rows(self) -> int:
        """R, number of rows of the basis, those of rotation and the bias f_0 included."""
        turning = TURN_SIZE if self.turns else 0
        return (self.expression_size + turning if self.blends else 0) + 1

    @property
    def width(self) -> int:
        """w, numbers per row and Gaussian; without an MLP these are the values themselves."""
        return self.features if self.has_mlp else self.outputs

    @property
    def mlp_inputs(self) -> int:
        """Width of the MLP's input."""
        direct = 0 if self.blends else self.expression_size
        return self.width + direct + 3 + 6 * self.frequencies


class HeadModel(nn.Module):
    """N Gaussians in canonical head space, driven by an expression.

    Geometry is static, or moves a little with the expression (`displaced`). Colour and opacity are
    φ(f, γ(μ)): the MLP φ reads the blended features f = Fᵀe + f_0 and the encoded position γ(μ) of
    each Gaussian. The values (N, V) that φ returns are logits of red, green, blue and opacity. If
    V > 4, coefficients of spherical harmonics above degree 0 follow, three colours each, which
    change the colours by the direction of view in canonical head space.

    Attributes:
        shape: Sizes and variant.
        means: (N, 3) metres.
        quats: (N, 4) wxyz, not normalised.
        log_scales: (N, 3) log of metres.
        basis: (R, N, w) latent basis F: rows of the expression, of the head's rotation, if it
            counts, and of the bias f_0.
        light: (N, 3) what is added to the logits of red, green and blue in every expression; only
            where the shape is `relit`.
        displacement_basis: (M, N, 3) metres by which Gaussians move where a coefficient is 1; only
            where the shape has `displacements`.
        move_w1, move_b1, move_w2, move_b2: (B, G), (G,), (G, M), (M,) layers of the network from an
            expression to coefficients of the displacements; fitted once the head is trained.
    """

    def __init__(self, shape: HeadShape, num_gaussians: int):
        """Creates a zero basis and identity rotations; the caller sets the geometry."""
        super().__init__()
        self.shape = shape
        count = num_gaussians
        self.means = nn.Parameter(torch.zeros(count, 3))
        # `repeat` would import sympy, which takes seconds, where shapes alone are wanted
        self.quats = nn.Parameter(torch.zeros(count, 4))
        self.quats.data[:, 0] = 1.0
        self.log_scales = nn.Parameter(torch.full((count, 3), -5.0))
        self.basis = nn.Parameter(torch.zeros(shape.rows, count, shape.width))
        if shape.relit:
            self.light = nn.Parameter(torch.zeros(count, 3))
        if shape.displacements:
            moved, size = shape.displacements, shape.expression_size
            self.displacement_basis = nn.Parameter(torch.zeros(moved, count, 3))
            layers = (size, MOVE_HIDDEN), (MOVE_HIDDEN,), (MOVE_HIDDEN, moved), (moved,)
            for name, sizes in zip(MOVE_NETWORK, layers, strict=True):
                self.register_buffer(name, torch.zeros(sizes))
        bias = math.log(INITIAL_OPACITY / (1 - INITIAL_OPACITY))
        if shape.has_mlp:
            self.trunk = nn.Linear(shape.mlp_inputs, shape.hidden)
            self.color_branch = nn.Linear(shape.hidden, 3)
            self.opacity_branch = nn.Linear(shape.hidden, 1)
            nn.init.constant_(self.opacity_branch.bias, bias)
            if shape.sh_degree:
                self.harmonics_branch = nn.Linear(shape.hidden, shape.outputs - 4)
                nn.init.zeros_(self.harmonics_branch.weight)
                nn.init.zeros_(self.harmonics_branch.bias)
        else:
            self.basis.data[-1, :, 3] = bias

    def __len__(self) -> int:
        """The number of Gaussians."""
        return self.means.shape[0]

    @property
    def device(self) -> torch.device:
        """The device of the parameters."""
        return self.means.device

    @property
    def gaussian_axes(self) -> dict[str, int]:
        """What this model has per Gaussian, with the axis along which the Gaussians lie."""
        axes = {"means": 0, "quats": 0, "log_scales": 0, "basis": 1}
        if self.shape.displacements:
            axes["displacement_basis"] = 1
        return axes | ({"light": 0} if self.shape.relit else {})

    def resize(self, num_gaussians: int) -> None:
        """Changes the number of Gaussians; the caller sets all values afterwards."""
        for name, axis in self.gaussian_axes.items():
            old = getattr(self, name)
            size = list(old.shape)
            size[axis] = num_gaussians
            setattr(self, name, nn.Parameter(old.new_empty(size), old.requires_grad))

    def forward(
        self,
        expression: Tensor,
        features: Tensor | None = None,
        moves: Tensor | None = None,
    ) -> Gaussians:
        """The Gaussians for an expression.

        Args:
            expression: (B,), on any device; sounds and captures give expressions on the CPU. The
                values (3,) of the head's rotation may follow; without them it is the mean one.
            features: (N, w) features that the basis was already blended to; None to blend them.
            moves: (M,) coefficients of the displacements; None for what the expression tells.

        Returns:
            Gaussians in canonical head space.
        """
        if moves is None:
            moves = self.moves(expression)
        return self.gaussians(self.logits(expression, features), moves)

    def logits(self, expression: Tensor, features: Tensor | None = None) -> Tensor:
        """(N, V) values of the Gaussians; expression and features as for `forward`."""
        if features is None:
            features = self.blended(expression)
        values = self.decode(features, expression)
        return _in_light(values, self.light) if self.shape.relit else values

    def blended(self, expression: Tensor) -> Tensor:
        """(N, w) blended features f for an expression (B,)."""
        return blend(self.basis, self.row_weights(expression))

    def row_weights(self, expression: Tensor) -> Tensor:
        """(R,) weights of the basis rows: the expression, the head's rotation, 1 for the bias."""
        one = torch.ones(1, dtype=self.basis.dtype, device=self.device)
        if not self.shape.blends:
            return one
        turned = one.new_zeros(self.shape.rows - 1 - len(expression))  # (3,) or (0,)
        return torch.cat([expression.to(self.device), turned, one])

    def decode(self, features: Tensor, expression: Tensor) -> Tensor:
        """The MLP φ: features (N, w) and expression (B,) to values (N, V)."""
        if not self.shape.has_mlp:
            return features
        if not self.shape.blends or not decoder.has_kernel(features, self.means):
            return self.branches(self.hidden(features, expression))
        return decoder.decode(
            features,
            self._positions(),
            self.shape.frequencies,
            (self.trunk.weight, self.trunk.bias),
            self._last_layer(),
        )

    def branches(self, hidden: Tensor) -> Tensor:
        """The last layer of φ: activations (N, hidden) to values (N, V)."""
        return nn.functional.linear(hidden, *self._last_layer())

    def _last_layer(self) -> tuple[Tensor, Tensor]:
        """Weight (V, hidden) and bias (V,) of the last layer of φ."""
        layers = [self.color_branch, self.opacity_branch]
        if self.shape.sh_degree:
            layers.append(self.harmonics_branch)
        weight = torch.cat([layer.weight for layer in layers])
        return weight, torch.cat([layer.bias for layer in layers])

    def hidden(self, features: Tensor, expression: Tensor) -> Tensor:
        """Input (N, hidden) of the last layer of φ; arguments as for `decode`."""
        parts = [features, *self.encoded_positions()]
        if not self.shape.blends:
            parts.append(expression.to(self.device).expand(len(self), -1))  # (N, B)
        return nn.functional.leaky_relu(self.trunk(torch.cat(parts, 1)), 0.01)  # (N, hidden)

    def encoded_positions(self) -> tuple[Tensor, Tensor]:
        """γ(μ) in two parts: positions in the head's box (N, 3), sines and cosines (N, 6·L)."""
        positions = self._positions()
        rates = decoder.octave_rates(self.shape.frequencies).to(positions)  # (L,)
        angles = (positions[:, None] * rates[:, None]).flatten(1)  # (N, 3·L)
        return positions, torch.cat([angles.sin(), angles.cos()], 1)

    def _positions(self) -> Tensor:
        """Positions (N, 3) in the head's box, about −1 … 1."""
        center = self.means.new_tensor(self.shape.box_center)
        return (self.means - center) / self.shape.box_size

    def moves(self, expression: Tensor) -> Tensor:
        """(M,) coefficients of the displacements that an expression (B,) tells.

        Values after the B, of the head's rotation, have no effect.
        """
        if not self.shape.displacements:
            return expression.new_zeros(0)
        w1, b1, w2, b2 = self.move_network
        hidden = expression[: self.shape.expression_size].to(w1) @ w1 + b1  # (G,)
        return nn.functional.leaky_relu(hidden, LEAKY_SLOPE) @ w2 + b2

    @property
    def move_network(self) -> list[Tensor]:
        """The layers of the network that `moves` evaluates."""
        return [getattr(self, name) for name in MOVE_NETWORK]

    def displaced(self, moves: Tensor) -> Tensor:
        """Centres (N, 3) in metres for coefficients (M,) of the displacements."""
        if not self.shape.displacements:
            return self.means
        shift = torch.einsum("m,mnc->nc", moves.to(self.means), self.displacement_basis)  # (N, 3)
        return self.means + shift

    def gaussians(self, logits: Tensor, moves: Tensor) -> Gaussians:
        """Renderable Gaussians with values (N, V), displaced by coefficients (M,)."""
        values, rest = torch.sigmoid(logits[:, :4]), logits[:, 4:]
        colors, sh = values[:, :3], None
        if rest.shape[1]:
            sh = harmonics.of_colors(colors, rest.unflatten(1, (-1, 3)))  # (N, K, 3)
        return Gaussians(
            means=self.displaced(moves),
            quats=self.quats,
            scales=self.log_scales.exp(),
            opacities=values[:, 3],
            colors=colors if sh is None else None,
            sh=sh,
        )

    def relit(self, change: Tensor) -> "HeadModel":
        """A copy in another light.

        Args:
            change: (N, 3) what the other light adds to the logits of red, green and blue, whatever
                the expression. Added to a logit, it multiplies c / (1 − c) of a colour c: a gain
                of light that runs into black and white as softly as on film.
        """
        model = HeadModel(replace(self.shape, relit=True), len(self)).to(self.device)
        values = dict(self.state_dict())
        values["light"] = values.get("light", 0) + change.to(self.means)  # (N, 3)
        model.load_state_dict(values)
        return model.requires_grad_(self.means.requires_grad)

    def save(self, path: Path) -> None:
        """Writes shape and parameters to one safetensors file."""
        save_tensors(path, dict(self.state_dict()), {"shape": asdict(self.shape)})

    @classmethod
    def load(cls, path: Path) -> "HeadModel":
        """Reads a file that `save` wrote.

        Raises:
            ModelError: If the file is missing, damaged, or does not hold a head model.
        """
        tensors, state = load_tensors(path)
        try:
            fields = dict(state["shape"])
            fields["box_center"] = tuple(fields["box_center"])
            if fields.get("neck") is not None:
                fields["neck"] = Neck(
                    **fields["neck"] | {"middle": tuple(fields["neck"]["middle"])}
                )
            shape, count = HeadShape(**fields), tensors["means"].shape[0]
            check_shapes(lambda: cls(shape, count), tensors)
            moving = ("displacement_basis", *MOVE_NETWORK)
            check_places(tensors["means"])
            if not all(all_finite(tensors[name]) for name in moving if name in tensors):
                raise ValueError("its displacements are not finite")
            check_width(count, shape.hidden, shape.mlp_inputs)
            model = cls(shape, count)
            model.load_state_dict(tensors)
        except (SettingsError, *DAMAGED) as error:
            raise ModelError(
                f"{path} does not hold a head model: {json.dumps(str(error))}."
            ) from error
        return model


def _in_light(values: Tensor, light: Tensor) -> Tensor:
    """Values (N, V) of Gaussians with (N, 3) added to the logits of their colours.

    Harmonics are small changes of a colour, so they change as the colour's derivative does.
    """
    logits = values[:, :3] + light  # (N, 3)
    if values.shape[1] == 4:
        return torch.cat([logits, values[:, 3:]], 1)  # (N, 4)
    before, after = (x.sigmoid() * (-x).sigmoid() for x in (values[:, :3], logits))  # (N, 3) each
    rest = values[:, 4:].unflatten(1, (-1, 3)) * (after / before.clamp_min(1e-6))[:, None]
    return torch.cat([logits, values[:, 3:4], rest.flatten(1)], 1)  # (N, V)
