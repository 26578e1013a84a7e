"""What is done to the packaged avatar once she is baked: arms, clothes, colours, light, lids."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from demo.lighting import lit_body, lit_head
from demo.matching import matched
from ico3d.avatar.baked_body import SkinnedBody
from ico3d.avatar.embodying.surfaces import main_joints
from ico3d.avatar.render_bundle import BakedAvatar, gaussians_at
from ico3d.avatar.staging import thumbnail
from ico3d.bundle.animation import ANIMATION, Rest
from ico3d.bundle.format import THUMBNAIL, Bundle, coarse_first, write_bundle
from ico3d.bundle.head import HEAD as HEAD_FILE
from ico3d.bundle.head import HEAD_REST, BakedHead
from ico3d.bundle.manifest import Manifest
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.gestures import gesture_files
from ico3d.bundle.skinned.info import SKINNED, SKINNED_REST
from ico3d.bundle.skinned.lamp import POINT_UNIT
from ico3d.common.expression import FACE_NAMES, LIDS, SPEECH_SIZE
from ico3d.rig.rig import Rig
from ico3d.splat.gaussians import Gaussians

RESTS = Rest(13, 14)
"""Frames of the body's recording in which she nods a little, with hanging arms."""
SHOULDERS, ARM = 0.02, "shoulder01"
"""Metres by which each arm is moved inwards once she is baked, since builds leave the skeleton as
it is, and the joints that begin an arm."""
TAKEN_IN = {
    "upperarm01": 0.07,
    "upperarm02": 0.12,
    "lowerarm01": 0.16,
    "lowerarm02": 0.16,
    "lowerleg01": 0.07,
    "lowerleg02": 0.08,
}
"""Share of the distance from these bones by which sleeves and trousers are taken in: the jumper of
the files is as wide at the elbow as at the shoulder, and a bent arm in it looks like a tube."""
NARROWED = {"lowerleg01.L": 0.02, "upperleg01.L": 0.10, "spine03": 0.11, "spine01": 0.03}
"""Share of its width by which the trunk becomes narrower at the heights of these joints, upwards;
of its depth, half of it."""
TRUNK = ("root", "pelvis", "spine", "upperleg", "clavicle", "shoulder01")
"""Beginnings of the names of joints on which the trunk hangs."""
BARE = ("wrist", "lowerarm02", "metacarpal", "finger", "neck", "spine01")
REDDEST = (0.9, 1.4)
"""Joints that carry bare skin, and by how much the logit of its red exceeds those of green and blue
at most: that of nineteen in twenty of the hands' Gaussians. Wool is blue and has none."""

SEAM, BESIDE, BELOW = 0.065, 0.12, (0.038, 0.05, 0.126, 0.146)
"""Metres from the middle within which the front of the trousers is evened, and up to where it
shows how; metres under the hips where that begins, is whole, begins to end, and has ended. Shade
between the legs and the end of a fly were no more than a spot to her cameras."""
EVENED = 0.8
"""Share of the difference that is taken away there."""
AWAKE = 0.1
"""Share of the way that lids take as they close by which hers are wider open: those of the files
hang low at rest, and people who saw her called her sleepy."""
SQUINT = 0.12
"""Share of the way that lids take as they close by which they do so in the widest smile: a smile of
the mouth alone looks polite at best."""
WARMER = 0.3
"""Share of the way from rest to the widest smile by which she smiles at rest: people who saw her
without took her for stern."""


def write_finished(path: Path) -> None:
    """Finishes a bundle that was just baked: arms, clothes, skin, light, gestures, and lids."""
    bundle = Bundle.open(path)
    assert bundle.skinned is not None
    body = lit_body(evened(muted(tailored(narrower(bundle.skinned)))))
    head, gestures = lit_head(composed(bundle.require_head()[0])), gesture_files(body, (), 1.0)
    write_person(path, bundle, bundle.manifest, head, body, gestures)


def write_person(
    path: Path,
    bundle: Bundle,
    manifest: Manifest,
    head: BakedHead,
    body: BakedSkinned,
    more: dict[str, bytes],
) -> None:
    """Writes a person's bundle anew, with this head and body, and a thumbnail of her at rest.

    She rests where her arms hang: a rule would have her rest where hands are still for longest, at
    her chin.

    Args:
        path: The file to write.
        bundle: All that stays as it is.
        manifest: Its manifest, with what `head` changes there.
        head: Takes the place of the bundle's.
        body: Takes the place of the bundle's.
        more: Further files, by name.
    """
    assert manifest.head is not None
    assert bundle.animation is not None  # its body moves
    old = (HEAD_REST, SKINNED_REST)
    files = {name: bundle.read(name) for name in bundle.manifest.files if name not in old}
    seconds, idle = RESTS.end / bundle.animation.fps, manifest.head.idle_expression
    person = BakedAvatar(head, SkinnedBody(body), bundle.require_head()[1])
    resting = person.gaussians(seconds, idle)

    def shown(body: BakedSkinned) -> Gaussians:
        return gaussians_at(SkinnedBody(body), seconds)

    body = matched(body, shown, resting[len(body.means) :])
    files |= {HEAD_FILE: head.to_bytes(), SKINNED: body.to_bytes()} | more
    files[ANIMATION] = replace(bundle.animation, rest=RESTS).to_bytes()
    resting = replace(person, body=SkinnedBody(body)).gaussians(seconds, idle)
    files[THUMBNAIL] = thumbnail(resting, manifest.camera, manifest.background)
    info = replace(manifest.head, num_rest=0)
    manifest = replace(manifest, head=info, skinned=replace(body.info, num_rest=0))
    write_bundle(path, *coarse_first(manifest, files))


def evened(body: BakedSkinned) -> BakedSkinned:
    """The body whose trousers are as plain between the legs as beside, in every pose."""
    legs = ("upperleg", "pelvis", "spine05")
    hips = body.rig.joints[body.rig.names.index("upperleg01.L"), 1]
    aside, under = np.abs(body.means[:, 0]), hips - body.means[:, 1]  # (N,), (N,)
    trousers = _hang_on(body, legs)
    front = trousers & (body.means[:, 2] > 0) & (under > BELOW[0])
    beside = front & (aside > SEAM) & (aside < BESIDE) & (under < BELOW[2])
    logits = body.color_logits.astype(np.float64)
    plain = np.median(logits[beside], axis=0)
    inside = np.clip((SEAM - aside) / (SEAM / 2), 0, 1) * np.interp(under, BELOW, (0, 1, 1, 0))
    share = EVENED * front * inside  # (N,)
    logits += share[:, None] * (plain - logits)
    shapes = body.shapes.astype(np.float64)
    shapes[..., 3:] *= 1 - share[:, None, None]
    changed = np.round(shapes).astype(np.int8)
    return replace(body, color_logits=logits.astype(np.float16), shapes=changed)


def composed(head: BakedHead) -> BakedHead:
    """The head with lids that are `AWAKE`, which smiles a little at rest, and with its eyes."""
    lids, smile = [SPEECH_SIZE + lid for lid in LIDS], SPEECH_SIZE + FACE_NAMES.index("smile")

    def with_rest(weights: np.ndarray, biases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        lidded = weights[lids].sum(0)
        smiling = weights[smile] + SQUINT * lidded
        warmer = weights.copy()
        warmer[smile] = (1 - WARMER) * smiling  # at its widest it is what it was
        return warmer, biases - AWAKE * lidded + WARMER * smiling

    w1, b1 = with_rest(head.w1, head.b1)
    displacement_w1, displacement_b1 = with_rest(head.displacement_w1, head.displacement_b1)
    moved = {"displacement_w1": displacement_w1, "displacement_b1": displacement_b1}
    return replace(head, w1=w1, b1=b1, **moved)


def narrower(body: BakedSkinned) -> BakedSkinned:
    """The body with its arms `SHOULDERS` nearer to the middle; what hangs on both goes part way."""
    rig = body.rig
    moves = np.zeros((len(rig), 3))
    for joint, parent in enumerate(rig.parents):
        if rig.names[joint].startswith(ARM):
            moves[joint, 0] = -SHOULDERS * np.sign(rig.joints[joint, 0])
        elif parent >= 0:
            moves[joint] = moves[parent]
    moved = replace(body, rig_joints=(body.rig_joints + moves).astype(np.float32))

    def carried(points: np.ndarray, joints: np.ndarray, share: np.ndarray) -> np.ndarray:
        return np.einsum("nk,nkd->nd", share, moves[joints])

    return _displaced(moved, carried)


def tailored(body: BakedSkinned) -> BakedSkinned:
    """The body in clothes that fit: `TAKEN_IN` and `NARROWED`."""
    rig = body.rig
    along, share_of = _bones(rig)
    trunk = np.array([name.startswith(TRUNK) for name in rig.names])
    at = {name: rig.joints[joint] for joint, name in enumerate(rig.names)}
    heights, shares = [at[name][1] for name in NARROWED], list(NARROWED.values())
    middle = at["spine03"] * (0, 0, 1)

    def taken_in(points: np.ndarray, joints: np.ndarray, share: np.ndarray) -> np.ndarray:
        away = points[:, None] - rig.joints[joints]  # (N, 4, 3)
        beside = away - (away * along[joints]).sum(-1, keepdims=True) * along[joints]
        moves = -np.einsum("nk,nkd->nd", share * share_of[joints], beside)
        less = (share * trunk[joints]).sum(1) * np.interp(points[:, 1], heights, shares)  # (N,)
        return moves - less[:, None] * (points - middle) * (1.0, 0.0, 0.5)

    return _displaced(body, taken_in)


def _bones(rig: Rig) -> tuple[np.ndarray, np.ndarray]:
    """(J, 3) unit directions of the bones of `TAKEN_IN`, and (J,) its shares; else 0."""
    along, shares = np.zeros((len(rig), 3)), np.zeros(len(rig))
    for joint, name in enumerate(rig.names):
        share = TAKEN_IN.get(name.partition(".")[0])
        if share is not None:
            end = rig.joints[rig.parents.index(joint)]  # of the one joint that it carries
            along[joint] = (end - rig.joints[joint]) / np.linalg.norm(end - rig.joints[joint])
            shares[joint] = share
    return along, shares


def _displaced(
    body: BakedSkinned, moves: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
) -> BakedSkinned:
    """The body whose Gaussians, and whose spheres that cast shadows, are moved at rest.

    Args:
        body: The body, recorded in the light of a lamp.
        moves: Metres (N, 3) by which points (N, 3) move that hang on joints (N, 4) by shares of 1
            (N, 4).
    """
    lamp = body.lamp
    assert lamp is not None

    def moved(points: np.ndarray, joints: np.ndarray, weights: np.ndarray) -> np.ndarray:
        share = weights / weights.sum(1, keepdims=True)  # (N, 4)
        return points + moves(points, joints, share)

    points = moved(lamp.caster_points * POINT_UNIT, lamp.caster_joints, lamp.caster_weights)
    casters = np.rint(points / POINT_UNIT).astype(np.int16)
    means = moved(body.means.astype(np.float64), body.joints, body.weights)
    return replace(body, means=means.astype(np.float32), lamp=replace(lamp, caster_points=casters))


def muted(body: BakedSkinned) -> BakedSkinned:
    """The body whose hands, wrists and neck are nowhere redder than `REDDEST`.

    Few pictures show skin in the shade of cuffs and collar, and what they show is red with the
    light that went through skin: seen from elsewhere it was a glowing ring.
    """
    bare = _hang_on(body, BARE)
    logits = body.color_logits.astype(np.float64)
    excess = np.maximum(logits[:, :1] - logits[:, 1:] - REDDEST, 0) * bare[:, None]  # (N, 2)
    logits[:, 1:] += 0.7 * excess
    logits[:, 0] -= 0.3 * excess.max(1)
    return replace(body, color_logits=logits.astype(np.float16))


def _hang_on(body: BakedSkinned, beginnings: tuple[str, ...]) -> np.ndarray:
    """(N,) bool: which Gaussians are carried most by joints whose names begin so."""
    return np.array([name.startswith(beginnings) for name in body.rig.names])[main_joints(body)]
