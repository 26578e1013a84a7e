"""Keeps Gaussians on a skeleton smaller than their bones, and bound to the limb that they show."""

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from ico3d.body.companion import MOMENTS, MOST
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.skinning.kinematics import transforms
from ico3d.body.skinning.sizes import bone_lengths, largest_log_scales
from ico3d.body.skinning.skinned import Skinned
from ico3d.body.skinning.template import Skin, hung_logits, sampled
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import conjugate, multiply, normalized

EVERY = 150
"""Steps between two tests of which Gaussians are bound to a wrong limb."""
POINTS = 20_000
"""Points of the template's skin to which distances are measured."""
OFF = 0.01
"""Gaussians within this distance of the skin at rest, in metres, keep their joints."""
NEAR = 0.03
"""Gaussians within this distance of the skin at rest, in metres, take its normals."""
NEARER = 0.75
"""A Gaussian is bound anew if posed skin is nearer than this share of its distance at rest."""


class OnBones:
    """Limits sizes and corrects bindings of Gaussians on a skeleton during their training."""

    def __init__(self, model: WindowModel, track: BodyTrack | None):
        """Measures bones and samples the template's skin.

        Args:
            model: The model; its motion must be `Skinned`.
            track: The body track, with the template; None to limit sizes only.
        """
        assert isinstance(model.motion, Skinned)
        self._motion = model.motion
        self._bones = bone_lengths(model.motion.parents, model.shared["rig_joints"])
        self._skin = None
        if track is not None:
            self._skin = sampled(track, POINTS, np.random.default_rng(0))

    @torch.no_grad()
    def limit_sizes(self, model: WindowModel) -> None:
        """Clamps the sizes of Gaussians to what their bones allow (`largest_log_scales`)."""
        values = model.gaussians
        most = largest_log_scales(self._bones, values["skin_joints"], values["skin_logits"])
        values["log_scales"].clamp_(max=most)

    @torch.no_grad()
    def rehang(self, model: WindowModel, index: int) -> int:
        """Binds Gaussians that have moved onto another limb to the joints of that limb.

        If an arm hangs beside the hip in all pictures, Gaussians of the hip may move over to show
        the arm; they would stay behind when the arm is raised. At rest limbs are far apart, so a
        Gaussian that is near some skin in most recorded poses, but far from all skin at rest, is
        bound to the wrong joints. Its pose in the middle of the clip stays as it is.

        Args:
            model: The model, which is changed in place.
            index: The step that was done; nothing happens but after each `EVERY` steps.

        Returns:
            Number of Gaussians that were bound anew.
        """
        if self._skin is None or index == 0 or index % EVERY:
            return 0
        values = model.gaussians
        away, which = KDTree(self._skin.points).query(_array(values["means"]))  # (N,)
        if "normals" in values:
            # Gaussians wander, and light goes by the skin where they have come to lie.
            near = torch.from_numpy(np.flatnonzero(away < NEAR)).to(model.device)  # (C,)
            facing = self._skin.normals[np.asarray(which)[away < NEAR]]  # (C, 3)
            values["normals"][near] = torch.from_numpy(facing).to(values["normals"])
        chosen = np.flatnonzero(away > OFF)
        times = np.zeros(len(chosen), int)
        for tau in np.linspace(0, 1, MOMENTS):
            near, _ = self._nearest(model, float(tau), chosen)
            times += near < NEARER * away[chosen]
        chosen = chosen[times >= MOST]
        if len(chosen):
            self._hang(model, chosen)
        return len(chosen)

    def _nearest(
        self, model: WindowModel, tau: float, chosen: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Distance (C,) in metres of C chosen Gaussians to the nearest skin at τ.

        Also (C,), the index of that point of the skin.
        """
        assert self._skin is not None
        table = self._table(model, tau).double().numpy()  # (J, 16)
        binding = self._skin.binding
        mixed = np.einsum("pk,pkc->pc", binding.weights, table[binding.joints])  # (P, 16)
        places = np.einsum("pab,pb->pa", mixed[:, :9].reshape(-1, 3, 3), self._skin.points)
        places += mixed[:, 9:12]  # (P, 3)
        near, which = KDTree(places).query(_array(model.at(tau).means)[chosen])
        return np.asarray(near), np.asarray(which)

    def _table(self, model: WindowModel, tau: float) -> Tensor:
        """(J, 16) transforms of the joints in the pose at τ, see `kinematics.transforms`."""
        values = {**model.gaussians, **model.shared}
        pose = self._motion.pose_at(values, tau)
        joints = model.shared["rig_joints"]
        return transforms(self._motion.parents, joints, pose.rotations, pose.root).cpu()

    def _hang(self, model: WindowModel, chosen: np.ndarray) -> None:
        """Binds C chosen Gaussians to the joints of the nearest skin; at τ = ½ they do not move.

        Adam's moments of the other limb stay: setting them to 0 gains nothing that counts
        (docs/choices.md, "Bodies on a skeleton").
        """
        assert self._skin is not None
        near: Skin = self._skin[self._nearest(model, 0.5, chosen)[1]]
        table = self._table(model, 0.5).double().numpy()  # (J, 16)
        mixed = np.einsum("ck,ckm->cm", near.binding.weights, table[near.binding.joints])  # (C, 16)
        drawn = model.at(0.5)
        shifted = _array(drawn.means)[chosen] - mixed[:, 9:12]  # (C, 3)
        rest = np.linalg.solve(mixed[:, :9].reshape(-1, 3, 3), shifted[..., None])[..., 0]  # (C, 3)
        quats = multiply(conjugate(normalized(mixed[:, 12:])), _array(drawn.quats)[chosen])
        found = {
            "means": rest,
            "quats": quats,
            "skin_joints": near.binding.joints.astype(np.int32),
            "skin_logits": hung_logits(near.binding),
            "normals": near.normals,
            # The residual shapes were learnt on another limb.
            "shape_means": 0.0,
            "shape_colors": 0.0,
        }
        rows = torch.from_numpy(chosen).to(model.device)
        for name, value in found.items():
            if name in model.gaussians:
                held = model.gaussians[name]
                held[rows] = torch.as_tensor(value).to(held)


def _array(tensor: Tensor) -> np.ndarray:
    return tensor.detach().cpu().double().numpy()
