"""The trained body on a skeleton that a baked one stands for."""

import numpy as np
import torch

from ico3d.body.motion.window_model import CANONICAL, WindowModel
from ico3d.body.skinning.coefficients import initial_network
from ico3d.body.skinning.skinned import NETWORK, Skinned
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.lamp import POINT_UNIT
from ico3d.bundle.skinned.posing import recorded_pose

HIDDEN = 6


def trained_like(baked: BakedSkinned, shapes: bool = True, light: bool = True) -> WindowModel:
    """With a network of its own, whose coefficients are about 5 and not alike in size."""
    info, units = baked.info, baked.shape_scales.astype(np.float32)
    poses = [recorded_pose(baked, frame) for frame in range(info.num_frames)]
    rotations = torch.from_numpy(np.stack([pose.rotations for pose in poses])).float()
    arrays = {
        "means": baked.means,
        "quats": baked.quats.astype(np.float32) * np.float32(1.7 / 32767),
        "log_scales": baked.log_scales.astype(np.float32),
        "opacity_logits": np.log(baked.opacities / (255.001 - baked.opacities)).astype(np.float32),
        "color_logits": baked.color_logits.astype(np.float32),
        "skin_joints": baked.joints.astype(np.int32),
        "skin_logits": np.log(np.maximum(baked.weights / np.float32(255), 1e-12)),
        "normals": baked.normals / np.float32(127),
        "shape_means": baked.shapes.astype(np.float32).transpose(0, 2, 1)[:, :3]
        * units[:, :1, None]
        / 1000,
        "shape_colors": baked.shapes.astype(np.float32).transpose(0, 2, 1)[:, 3:]
        * units[:, 1:, None],
        "rig_joints": baked.rig_joints,
        "light": baked.light,
    }
    lamp = baked.lamp if light else None
    if lamp:
        arrays |= {
            "lamp_direction": lamp.lamp_direction,
            "lamp_strength": np.log(lamp.lamp_strength),
            "caster_points": lamp.caster_points * np.float32(POINT_UNIT),
            "caster_joints": lamp.caster_joints.astype(np.int32),
            "caster_weights": lamp.caster_weights / np.float32(255),
        }
    values = {name: torch.as_tensor(array) for name, array in arrays.items()}
    values["pose_rotations"] = rotations
    values["pose_roots"] = torch.from_numpy(baked.roots.copy())
    count = info.num_shapes if shapes else 0
    generator = torch.Generator().manual_seed(0)
    network = initial_network(rotations, HIDDEN, info.num_shapes, generator)
    network["bias1"] = torch.linspace(-5, 5, info.num_shapes)
    values |= {NETWORK + name: value for name, value in network.items()}
    lit = light, lamp is not None
    motion = Skinned(info.names, info.parents, info.num_frames, count, HIDDEN, *lit)
    gaussians = {name: values[name] for name in (*CANONICAL, *motion.per_gaussian)}
    return WindowModel(motion, gaussians, {name: values[name] for name in motion.shared})
