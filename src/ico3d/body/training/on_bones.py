"""What keeps Gaussians on a skeleton where they belong: short, and on the limb that they show."""

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
"""Steps from one look at who hangs where to the next."""
POINTS = 20_000
"""On the template."""
OFF = 0.01
"""Metres from the skin at rest below which a Gaussian belongs where it hangs."""
NEARER = 0.75
"""Part of that distance within which another limb's skin must come."""


class OnBones:
    """Looks after the Gaussians of a body on a skeleton while they are trained."""

    def __init__(self, model: WindowModel, track: BodyTrack | None):
        """Gets ready.

        Args:
            model: Its motion is `Skinned`.
            track: Whose template says where limbs are; None to look at sizes alone.
        """
        assert isinstance(model.motion, Skinned)
        self._motion = model.motion
        self._bones = bone_lengths(model.motion.parents, model.shared["rig_joints"])
        self._skin = None
        if track is not None:
            self._skin = sampled(track, POINTS, np.random.default_rng(0))

    @torch.no_grad()
    def limit_sizes(self, model: WindowModel) -> None:
        """No Gaussian gets longer than its bone allows."""
        values = model.gaussians
        most = largest_log_scales(self._bones, values["skin_joints"], values["skin_logits"])
        values["log_scales"].clamp_(max=most)

    @torch.no_grad()
    def rehang(self, model: WindowModel, index: int) -> int:
        """What has come to lie on another limb hangs on that limb from now on.

        Pictures of an arm that hangs all the time do not tell it from the hip beside it: parts of
        the hip move over to show it, and stay behind when the arm is raised. At rest limbs are far
        apart, so what is near to some skin in most recorded poses and far from all skin at rest
        hangs on the wrong joints. It stays where it is in the middle of the clip.

        Args:
            model: Changed in place.
            index: The step that was done.

        Returns:
            How many Gaussians were hung anew.
        """
        if self._skin is None or index == 0 or index % EVERY:
            return 0
        values = model.gaussians
        away = KDTree(self._skin.points).query(_array(values["means"]))[0]  # (N,)
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
        """How far some Gaussians (C,) are from the nearest skin at τ, and which point that is."""
        assert self._skin is not None
        table = self._table(model, tau).double().numpy()  # (J, 16)
        binding = self._skin.binding
        mixed = np.einsum("pk,pkc->pc", binding.weights, table[binding.joints])  # (P, 16)
        places = np.einsum("pab,pb->pa", mixed[:, :9].reshape(-1, 3, 3), self._skin.points)
        places += mixed[:, 9:12]
        near, which = KDTree(places).query(_array(model.at(tau).means)[chosen])
        return np.asarray(near), np.asarray(which)

    def _table(self, model: WindowModel, tau: float) -> Tensor:
        """(J, 16) of `transforms` in the pose at τ."""
        values = {**model.gaussians, **model.shared}
        pose = self._motion.pose_at(values, tau)
        joints = model.shared["rig_joints"]
        return transforms(self._motion.parents, joints, pose.rotations, pose.root).cpu()

    def _hang(self, model: WindowModel, chosen: np.ndarray) -> None:
        """Hangs some Gaussians (C,) on the nearest skin's joints, seen as before at τ = ½."""
        assert self._skin is not None
        near: Skin = self._skin[self._nearest(model, 0.5, chosen)[1]]
        table = self._table(model, 0.5).double().numpy()  # (J, 16)
        mixed = np.einsum("ck,ckm->cm", near.binding.weights, table[near.binding.joints])  # (C, 16)
        drawn = model.at(0.5)
        shifted = _array(drawn.means)[chosen] - mixed[:, 9:12]  # (C, 3)
        rest = np.linalg.solve(mixed[:, :9].reshape(-1, 3, 3), shifted[..., None])[..., 0]
        quats = multiply(conjugate(normalized(mixed[:, 12:])), _array(drawn.quats)[chosen])
        found = {
            "means": rest,
            "quats": quats,
            "skin_joints": near.binding.joints.astype(np.int32),
            "skin_logits": hung_logits(near.binding),
            "normals": near.normals,
            # Shapes were those of another limb's pose.
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
