"""A head on a skeleton: it is fixed rigidly to the head's joint, in every pose."""

import numpy as np
from scipy.spatial.transform import Rotation

from ico3d.body.model_folder import TrainedBody
from ico3d.body.skinning.skinned import Skinned
from ico3d.errors import SettingsError
from ico3d.motion.roles import cast
from ico3d.rig.quaternions import normalized
from ico3d.rig.rig import Rig


def head_joint(rig: Rig) -> int | None:
    """Index of the joint that carries the head; None in a rig that lacks a person's joints."""
    try:
        return cast(rig).joints["head"][-1]
    except SettingsError:
        return None


def rig_of(body: TrainedBody) -> Rig | None:
    """The skeleton of a trained body; None for a body of windows, which has none."""
    model = body.models[0]
    if not isinstance(model.motion, Skinned):
        return None
    joints = model.shared["rig_joints"].detach().cpu().double().numpy()  # (J, 3)
    return Rig(model.motion.names, model.motion.parents, joints)


def trained_poses(body: TrainedBody) -> tuple[np.ndarray, np.ndarray]:
    """The trained pose of each frame of a body on a skeleton.

    Returns:
        (F, J, 4) unit quaternions wxyz, one per joint, and (F, 3) translations of the root in
        metres; float64.
    """
    shared = body.models[0].shared
    rotations = shared["pose_rotations"].detach().cpu().double().numpy()  # (F, J, 4)
    return normalized(rotations), shared["pose_roots"].detach().cpu().double().numpy()


def hung(world_from_canonical: np.ndarray, body: TrainedBody) -> np.ndarray:
    """Head poses of a head that is fixed rigidly to its joint.

    Its pose relative to the joint is the mean of the recorded poses relative to the joint.

    Args:
        world_from_canonical: (F, 4, 4) rigid head poses, as recorded.
        body: A body with a trained pose for each of the F frames.

    Returns:
        (F, 4, 4) rigid; the recorded poses unchanged where the body has no joint for its head.
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
