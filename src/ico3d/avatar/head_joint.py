"""A head on a skeleton: it hangs rigidly on its joint, in recorded poses and in any other."""

import numpy as np
from scipy.spatial.transform import Rotation

from ico3d.body.model_folder import TrainedBody
from ico3d.body.skinning.skinned import Skinned
from ico3d.errors import SettingsError
from ico3d.motion.roles import cast
from ico3d.rig.quaternions import normalized
from ico3d.rig.rig import Rig


def head_joint(rig: Rig) -> int | None:
    """The joint that carries the head; None in a rig that lacks the roles of a person."""
    try:
        return cast(rig).joints["head"][-1]
    except SettingsError:
        return None


def rig_of(body: TrainedBody) -> Rig | None:
    """The skeleton of a body; None of a body of windows."""
    model = body.models[0]
    if not isinstance(model.motion, Skinned):
        return None
    joints = model.shared["rig_joints"].detach().cpu().double().numpy()  # (J, 3)
    return Rig(model.motion.names, model.motion.parents, joints)


def trained_poses(body: TrainedBody) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (F, J, 4) and roots (F, 3) of a body on a skeleton, as they were trained."""
    shared = body.models[0].shared
    rotations = shared["pose_rotations"].detach().cpu().double().numpy()  # (F, J, 4)
    return normalized(rotations), shared["pose_roots"].detach().cpu().double().numpy()


def hung(world_from_canonical: np.ndarray, body: TrainedBody) -> np.ndarray:
    """Head poses as the joint carries the head: on average over the clip where it was recorded.

    Args:
        world_from_canonical: (F, 4, 4) rigid, as recorded.
        body: With a trained pose for each of the frames.

    Returns:
        (F, 4, 4); what was recorded where the body has no joint for its head.
    """
    rig = rig_of(body)
    joint = None if rig is None else head_joint(rig)
    if rig is None or joint is None:
        return world_from_canonical
    carried = rig.matrices(*trained_poses(body))[:, joint]  # (F, 4, 4)
    local = np.linalg.inv(carried) @ world_from_canonical  # (F, 4, 4)
    mean = np.eye(4)
    mean[:3, :3] = Rotation.from_matrix(local[:, :3, :3]).mean().as_matrix()
    mean[:3, 3] = local[:, :3, 3].mean(0)
    return carried @ mean
