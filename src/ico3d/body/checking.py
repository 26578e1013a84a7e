"""Whether tensors are what their motion says, before kernels that trust them read any."""

import math

from ico3d.body.motion.deformation import GRID, MLP, Deformation
from ico3d.body.motion.formulas import Polynomial
from ico3d.body.motion.window_model import HARMONICS, Motion, WindowModel
from ico3d.body.skinning.kernels import INFLUENCES
from ico3d.body.skinning.light import LIGHTS
from ico3d.body.skinning.skinned import NETWORK, Skinned
from ico3d.rig.rig import Rig
from ico3d.splat import harmonics
from ico3d.training.checkpoint import Size, check_places, check_tensor, check_width

CANONICAL_ROWS: dict[str, Size] = {
    "means": (3,),
    "quats": (4,),
    "log_scales": (3,),
    "opacity_logits": (),
    "color_logits": (3,),
}
"""Shapes of one Gaussian's rows of the tensors that all Gaussians have."""
COLOR_MAP = (3, 4)
"""Shape of how one camera's colours differ."""


def check_window(model: WindowModel) -> None:
    """Compares all tensors of a window with what its motion says of them.

    Raises:
        ValueError: If a tensor has another type or shape, is not finite, or holds the number of a
            joint that is not there.
    """
    motion, count = model.motion, len(model)
    rows = CANONICAL_ROWS | _rows(motion)
    if HARMONICS in model.gaussians:
        rows[HARMONICS] = (harmonics_of(model), 3)
    sizes = {name: (count, *row) for name, row in rows.items()} | _shared(motion)
    limits = _limits(motion)
    for name, tensor in {**model.gaussians, **model.shared}.items():
        check_tensor(name, tensor, sizes[name], limits.get(name))
    check_places(model.gaussians["means"])
    if model.camera_colors is not None:
        check_tensor("camera_colors", model.camera_colors, (None, *COLOR_MAP))
    if isinstance(motion, Skinned):
        _check_skeleton(motion, model)
    if isinstance(motion, Deformation):
        _check_box(motion)
        check_width(count, motion.mlp.inputs, motion.mlp.width)


def harmonics_of(model: WindowModel) -> int:
    """Number of coefficients of a Gaussian's harmonics above degree 0.

    Raises:
        ValueError: If no degree has this number.
    """
    count = (*model.gaussians[HARMONICS].shape, 0, 0)[1]
    harmonics.degree_of(1 + count)
    return count


def _rows(motion: Motion) -> dict[str, Size]:
    """Shapes of one Gaussian's rows of the tensors that it has for a motion."""
    if isinstance(motion, Polynomial):
        rows: dict[str, Size] = {"center": (), "log_duration": (), "path": (motion.degree, 3)}
        return rows | ({"turn": (4,)} if motion.turning else {})
    if isinstance(motion, Deformation):
        return {"alpha": (motion.mlp.sets,)} if motion.mlp.sets > 1 else {}
    if isinstance(motion, Skinned):
        shapes = (3, motion.shapes)
        rows = {"skin_joints": (INFLUENCES,), "skin_logits": (INFLUENCES,), "normals": (3,)}
        return rows | {"shape_means": shapes, "shape_colors": shapes}
    return {}


def _shared(motion: Motion) -> dict[str, Size]:
    """Shapes of the tensors that all Gaussians share."""
    if isinstance(motion, Deformation):
        sizes: dict[str, Size] = {MLP + n: size for n, size in motion.mlp.weights.items()}
        grid = motion.encoder
        for scale in range(0 if grid is None else len(grid.space)):
            assert grid is not None
            sizes |= {GRID + n: size for n, size in grid.planes(scale).items()}
        return sizes
    if not isinstance(motion, Skinned):
        return {}
    joints, frames = len(motion.names), motion.frames
    network: dict[str, Size] = {
        "weight0": (3 * joints, motion.hidden),
        "bias0": (motion.hidden,),
        "weight1": (motion.hidden, motion.shapes),
        "bias1": (motion.shapes,),
    }
    skeleton: dict[str, Size] = {
        "rig_joints": (joints, 3),
        "pose_rotations": (frames, joints, 4),
        "pose_roots": (frames, 3),
        "light": (LIGHTS, 3),
        "lamp_direction": (3,),
        "lamp_strength": (3,),
        "caster_points": (None, 3),
        "caster_joints": (None, INFLUENCES),
        "caster_weights": (None, INFLUENCES),
    }
    return skeleton | {NETWORK + name: size for name, size in network.items()}


def _limits(motion: Motion) -> dict[str, int]:
    """Names of tensors of numbers of joints, and below what these stay."""
    if not isinstance(motion, Skinned):
        return {}
    return dict.fromkeys(("skin_joints", "caster_joints"), len(motion.names))


def _check_skeleton(motion: Skinned, model: WindowModel) -> None:
    """Raises ValueError if the joints are no tree, or spheres differ in number."""
    Rig(motion.names, motion.parents, model.shared["rig_joints"].detach().cpu().double().numpy())
    casters = [tensor for name, tensor in model.shared.items() if name.startswith("caster_")]
    if len({len(tensor) for tensor in casters}) > 1:
        raise ValueError("caster_points, caster_joints and caster_weights differ in number")


def _check_box(motion: Deformation) -> None:
    """Raises ValueError if the box of the motion is none."""
    sides = (*motion.middle, *motion.half)
    finite = len(motion.middle) == len(motion.half) == 3 and all(map(math.isfinite, sides))
    if not finite or min(motion.half) <= 0:
        raise ValueError(f"its box about {motion.middle} of half edges {motion.half} is none")
