"""Rounds a trained body on a skeleton to the number formats of a bundle."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ico3d.body.motion.window_model import WindowModel
from ico3d.body.skinning import coefficients
from ico3d.body.skinning.skinned import NETWORK, Skinned
from ico3d.bundle.limits import MAX_KNOWN_POSES
from ico3d.bundle.skinned.baked import SCALE_UNITS, BakedSkinned
from ico3d.bundle.skinned.info import SkinnedInfo
from ico3d.bundle.skinned.lamp import POINT_UNIT, BakedLamp
from ico3d.bundle.skinned.packing import packed_quats, packed_rotations, packed_weights
from ico3d.bundle.tensors import QUAT_UNIT
from ico3d.common.spread import spread
from ico3d.rig.pose_regression import kernel_width

STILL = 0.05
"""A joint that turns by no more than this many degrees in the recording is stored as held."""
_LEAST = 1e-6
"""Least standard deviation of a shape's coefficients that they are divided by."""
_CLEAR = 0.5 / 255
"""Gaussians up to this opacity, which 8 bits round to 0, are left out."""


@dataclass(frozen=True)
class Clip:
    """Facts about the recorded clip for the manifest of a body on a skeleton.

    Attributes:
        fps: Frames per second.
        low: Least x, y, z of the visible Gaussians' centres in the clip, metres.
        high: Greatest x, y, z of these centres.
    """

    fps: float
    low: tuple[float, float, float]
    high: tuple[float, float, float]


def quantised(model: WindowModel, clip: Clip, importance: np.ndarray) -> BakedSkinned:
    """Rounds a trained body on a skeleton, and sorts its Gaussians by importance.

    Args:
        model: The trained body; its motion must be `Skinned`.
        clip: Frame rate and bounds of the recorded clip.
        importance: (N,) importance of each Gaussian; the most important ones come first.
    """
    motion = model.motion
    assert isinstance(motion, Skinned)
    shared = {name: value.detach().cpu() for name, value in model.shared.items()}
    opacities = model.gaussians["opacity_logits"].detach().cpu().sigmoid().numpy()  # (N,)
    order = np.argsort(-importance, kind="stable")
    order = order[opacities[order] > _CLEAR]  # (N',) indices of the Gaussians that are kept
    values = {n: v.detach().cpu()[torch.from_numpy(order)] for n, v in model.gaussians.items()}
    arrays = {name: value.numpy() for name, value in values.items()}
    shapes = _shapes(motion, values, shared)
    poses = _poses(shared, motion)
    weights = values["skin_logits"].softmax(1).numpy()  # (N, 4)
    strongest = np.argsort(-weights, axis=1, kind="stable")  # (N, 4)
    normals = arrays["normals"] if motion.light else np.zeros_like(arrays["means"])
    light = shared["light"].numpy() if motion.light else np.zeros((8, 3))
    info = SkinnedInfo(
        fps=clip.fps,
        num_frames=motion.frames,
        num_gaussians=len(order),
        num_shapes=shapes.basis.shape[1],
        num_moving=len(poses["moving"]),
        num_known=len(poses["known"]),
        names=motion.names,
        parents=motion.parents,
        low=clip.low,
        high=clip.high,
        num_casters=len(shared["caster_points"]) if motion.shadow else 0,
    )
    return BakedSkinned(
        means=shapes.means.astype(np.float32),
        quats=packed_quats(arrays["quats"].astype(np.float64)),
        log_scales=arrays["log_scales"].astype(np.float16),
        color_logits=shapes.colors.astype(np.float16),
        opacities=np.rint(opacities[order] * 255).astype(np.uint8),
        normals=np.rint(normals * 127).astype(np.int8),
        joints=np.take_along_axis(arrays["skin_joints"], strongest, 1).astype(np.uint8),
        weights=packed_weights(np.take_along_axis(weights, strongest, 1)),
        shapes=shapes.basis,
        shape_scales=shapes.scales,
        light=light.astype(np.float32),
        rig_joints=shared["rig_joints"].numpy().astype(np.float32),
        coefficients=shapes.coefficients.astype(np.float32),
        info=info,
        lamp=_lamp(shared) if motion.shadow else None,
        **poses,
    )


def _lamp(shared: Mapping[str, Tensor]) -> BakedLamp:
    """The lamp and what stands in its light."""
    return BakedLamp(
        lamp_direction=shared["lamp_direction"].numpy(),
        lamp_strength=shared["lamp_strength"].exp().numpy(),
        caster_points=np.rint(shared["caster_points"].numpy() / POINT_UNIT).astype(np.int16),
        caster_joints=shared["caster_joints"].numpy().astype(np.uint8),
        caster_weights=packed_weights(shared["caster_weights"].numpy()),
    )


@dataclass(frozen=True, eq=False)
class _Shapes:
    """Residual shapes in eight bits: offsets of positions and colour logits that a pose mixes.

    Attributes:
        means: (N, 3) positions at rest, plus the mean residual of the recorded frames.
        colors: (N, 3) colour logits, plus the mean residual of the recorded frames.
        basis: (N, K, 6) int8: three numbers of position and three of colour for each shape.
        scales: (N, 2) float16 scale of positions and of colours, in `SCALE_UNITS`.
        coefficients: (F, K) coefficients of the recorded frames, with mean 0 and deviation 1.
    """

    means: np.ndarray
    colors: np.ndarray
    basis: np.ndarray
    scales: np.ndarray
    coefficients: np.ndarray


def _shapes(motion: Skinned, values: Mapping[str, Tensor], shared: Mapping[str, Tensor]) -> _Shapes:
    """Moves the mean residual into the Gaussians, and rounds the shapes to eight bits.

    Coefficients of any pose are a weighted mean of recorded ones. As the weights sum to 1, the
    residual that all frames share can be added to the Gaussians, also for poses that were never
    recorded. All shapes of a Gaussian share one scale, so each shape is multiplied by the standard
    deviation of its coefficients before it is rounded.
    """
    means, colors = values["means"].numpy(), values["color_logits"].numpy()  # (N, 3)
    if not motion.shapes:  # a bundle has at least one shape: here one that is 0
        count, frames = len(means), motion.frames
        empty = np.zeros((count, 1, 6), np.int8), np.zeros((count, 2), np.float16)
        return _Shapes(means, colors, *empty, np.zeros((frames, 1)))
    network = {layer: shared[NETWORK + layer] for layer in coefficients.LAYERS}
    mixed = coefficients.network(network, shared["pose_rotations"]).double().numpy()  # (F, K)
    basis = np.stack([values["shape_means"].numpy(), values["shape_colors"].numpy()], 1)
    basis = basis.astype(np.float64).transpose(0, 3, 1, 2)  # (N, K, 2, 3)
    middle = mixed.mean(axis=0)  # (K,)
    common = np.einsum("k,nkpd->npd", middle, basis)  # (N, 2, 3)
    sizes = np.maximum((mixed - middle).std(axis=0), _LEAST)  # (K,)
    basis = basis * sizes[:, None, None]
    units = np.array(SCALE_UNITS)
    scales = np.abs(basis).max(axis=(1, 3)) / 127 / units  # (N, 2)
    # Scales are rounded upwards, so that no value of a shape exceeds 127.
    scales = np.nextafter(scales.astype(np.float16), np.float16(np.inf))
    whole = np.rint(basis / (scales * units)[:, None, :, None]).clip(-127, 127)
    return _Shapes(
        means + common[:, 0],
        colors + common[:, 1],
        whole.astype(np.int8).reshape(len(means), -1, 6),
        scales,
        (mixed - middle) / sizes,
    )


def _poses(shared: Mapping[str, Tensor], motion: Skinned) -> dict[str, np.ndarray]:
    """Tensors of the recorded motion, by their names in the bundle's file."""
    turns = shared["pose_rotations"].double().numpy()  # (F, J, 4)
    held, moving, rotations = packed_rotations(turns, STILL)
    known = np.array(spread(motion.frames, MAX_KNOWN_POSES), np.int16)
    width = kernel_width(rotations[known] / QUAT_UNIT)
    return {
        "held": held,
        "moving": moving,
        "rotations": rotations,
        "roots": shared["pose_roots"].numpy().astype(np.float32),
        "known": known,
        "kernel_width": np.array([width], np.float32),
    }
