"""Puts the head of one bundle on the body of another."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from ico3d.avatar import staging
from ico3d.avatar.baked_body import SkinnedBody
from ico3d.avatar.baking.eyes.eyeballs import with_still_eyes, with_turning_eyes
from ico3d.avatar.baking.person_bundle import moved_head
from ico3d.avatar.embodying.builds.change import change_to
from ico3d.avatar.embodying.builds.names import MEDIUM
from ico3d.avatar.embodying.builds.reshape import gestures_in, reshaped
from ico3d.avatar.embodying.drawn_colors import drawn_colors
from ico3d.avatar.embodying.face import Face
from ico3d.avatar.embodying.look import AS_RECORDED, UNCHANGED, Look
from ico3d.avatar.embodying.outfits import dressed
from ico3d.avatar.embodying.surfaces import Surfaces, surfaces_of
from ico3d.avatar.embodying.telling import told_together
from ico3d.avatar.joining.finding.found_face import face_seeker
from ico3d.avatar.joining.similarity import canonical_from_head, fit_in_words, moved
from ico3d.avatar.render_bundle import BakedAvatar, baked_gaussians
from ico3d.bundle.animation import ANIMATION
from ico3d.bundle.format import LICENSES, SPEECH, THUMBNAIL, Bundle, coarse_first, write_bundle
from ico3d.bundle.head import HEAD, POSES, BakedHead, poses_to_bytes
from ico3d.bundle.manifest import Loss, Manifest
from ico3d.bundle.people.voice import VOICE
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.gestures import GESTURES
from ico3d.bundle.skinned.info import SKINNED
from ico3d.errors import BundleError, ModelError
from ico3d.motion.roles import cast
from ico3d.splat.gaussians import Gaussians

Report = Callable[[str], None]
"""Prints a line about the progress."""
BOUND = 2.5
"""Most by which a colour's logit may change: more than from the palest skin to the darkest."""


def embody(
    head: Bundle, body: Bundle, out: Path, report: Report, look: Look = UNCHANGED
) -> Manifest:
    """Writes a whole person: the head of one bundle on the body of another.

    The head is given the size of the head that is on the body, and its place on the joint; what
    the body has of its own head is removed where the given one is; its skin and its hair take the
    colours of the given head. How the person speaks, and who they are, comes with the head; how
    they move, with the body.

    Args:
        head: The bundle with the head; a body in it is left out.
        body: The bundle of a whole person on a skeleton.
        out: The file to write.
        report: Called with what was measured.
        look: Build and outfit of the body.

    Raises:
        BundleError: If one of the bundles lacks a head, the second a body on a skeleton, or that
            body cannot look so.
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If the file of MediaPipe's face landmarker is not there.
        ModelError: If a head shows no face.
    """
    given, _ = head.require_head()
    own, poses = body.require_head()
    skinned = body_in(body)
    faces = _landmarks(head, given), _landmarks(body, own)
    matrix, rest = canonical_from_head(faces[1], faces[0])
    report(fit_in_words(matrix, rest))
    placed, marks = moved_head(_with_still_eyes(head, given), matrix), moved(matrix, faces[0])
    face, before = Face.of(marks), Face.of(faces[1])
    shown = _cropped(placed, face)
    there = SkinnedBody(skinned).window_gaussians(0, 0.0)
    there = there.transform(np.linalg.inv(poses[0].astype(np.float64)))  # in head space
    means = there.means.numpy().astype(np.float64)  # (N, 3)
    behind = before.in_crown(means) & (before.behind(means) > 0)
    roles = cast(skinned.rig)
    surfaces = surfaces_of(skinned, roles, behind)
    kept = ~(surfaces.head & (face.region.depth(means) > 0))
    kept &= ~((surfaces.head | (surfaces.hair > 0.5)) & before.beyond(means))
    idle = _idle(head, shown)
    skin, hair = _gains((idle, face), (_idle(body, own), before), there[torch.from_numpy(kept)])
    report(_gains_in_words(skin, hair))
    clothed = dressed(skinned, roles, surfaces, look.outfit)
    tinted = _tinted(clothed, surfaces, skin, hair).chosen(np.flatnonzero(kept))
    return _written(out, head, body, (shown, marks), reshaped(tinted, look.build), look)


def body_in(bundle: Bundle, look: Look = UNCHANGED) -> BakedSkinned:
    """The body that can stand in for that of another person.

    Args:
        bundle: A whole person.
        look: Build and outfit that the body is to have.

    Raises:
        BundleError: If the bundle lacks a head, or a body on a skeleton that can look so.
    """
    bundle.require_head()
    if bundle.skinned is None:
        raise BundleError(
            f"the bundle of '{bundle.manifest.name}' has no body on a skeleton, which a head of "
            "another person could move with."
        )
    body = bundle.skinned
    if look.build != MEDIUM:
        change_to(look.build, body.rig)
    if look.outfit != AS_RECORDED:
        roles, none = cast(body.rig), np.zeros(body.info.num_gaussians, bool)
        dressed(body, roles, surfaces_of(body, roles, none), look.outfit)
    return body


def _landmarks(bundle: Bundle, head: BakedHead) -> np.ndarray:
    """(68, 3) landmarks of a head at rest, in its space."""
    with torch.no_grad(), face_seeker() as seeker:
        return seeker.of_head(_idle(bundle, head), Path(bundle.manifest.name)).landmarks


def _idle(bundle: Bundle, head: BakedHead) -> Gaussians:
    """A head with the face of the bundle's at rest."""
    assert bundle.manifest.head is not None
    return baked_gaussians(head, np.array(bundle.manifest.head.idle_expression, np.float32))


def _with_still_eyes(bundle: Bundle, head: BakedHead) -> BakedHead:
    """The bundle's head without what turns its eyes, which is about the axes of its own space."""
    assert bundle.manifest.head is not None
    return head if bundle.manifest.head.gaze is None else with_still_eyes(head)


def _cropped(head: BakedHead, face: Face) -> BakedHead:
    """The Gaussians of a head that are drawn on a body.

    Raises:
        ModelError: If there are none.
    """
    means = head.means.astype(np.float64)
    inside = (face.region.depth(means) > 0) & ~face.region.floating(means)
    if not inside.any():
        raise ModelError("no Gaussian of the head lies where its face was found.")
    return head.chosen(np.flatnonzero(inside))


def _gains(
    given: tuple[Gaussians, Face], own: tuple[Gaussians, Face], rest: Gaussians
) -> tuple[np.ndarray, np.ndarray]:
    """By how much logits of the body's skin and hair change.

    Args:
        given: The given head and its face.
        own: The head that was on the body, and its face.
        rest: The body without it, in canonical head space.

    Returns:
        (3,) for skin, from cheek to cheek, and (3,) for hair, from the back edge of the given head
        to what of the body is behind it. 0 where too little is seen of one of them.
    """
    face, before = given[1], own[1]
    skin, hair = drawn_colors(given[0], face.middle, [face.on_cheeks, face.on_back_edge])
    (cheeks,) = drawn_colors(own[0], before.middle, [before.on_cheeks])
    (behind,) = drawn_colors(rest, face.middle, [face.just_behind])
    return _change(cheeks, skin), _change(behind, hair)


def _change(before: np.ndarray | None, after: np.ndarray | None) -> np.ndarray:
    if before is None or after is None:
        return np.zeros(3)
    return (after - before).clip(-BOUND, BOUND)


def _tinted(
    body: BakedSkinned, surfaces: Surfaces, skin: np.ndarray, hair: np.ndarray
) -> BakedSkinned:
    """The body with other colours of skin and hair."""
    change = surfaces.skin[:, None] * skin + surfaces.hair[:, None] * hair  # (N, 3)
    return replace(body, color_logits=(body.color_logits + change).astype(np.float16))


def _gains_in_words(skin: np.ndarray, hair: np.ndarray) -> str:
    parts = (
        f"{name} by {', '.join(f'{value:+.2f}' for value in gain)}"
        for name, gain in (("skin", skin), ("hair", hair))
    )
    return f"the body's colours change in logits of r, g, b: {'; '.join(parts)}."


def _written(
    out: Path,
    head: Bundle,
    body: Bundle,
    placed: tuple[BakedHead, np.ndarray],
    tinted: BakedSkinned,
    look: Look,
) -> Manifest:
    """Writes the person, whose head is given with its landmarks (68, 3) where it is placed."""
    about, moving = head.manifest, body.manifest
    assert about.head is not None and moving.head is not None
    _, poses = body.require_head()
    idle = np.array(about.head.idle_expression, np.float32)
    shown, gaze = with_turning_eyes(placed[0], idle, placed[1])
    person = BakedAvatar(shown, SkinnedBody(tinted), poses)
    first = person.gaussians(0.0, about.head.idle_expression)
    files = (
        {ANIMATION: body.read(ANIMATION)}
        | _gestures(body, tinted, look)
        | {
            HEAD: shown.to_bytes(),
            POSES: poses_to_bytes(poses),
            SKINNED: tinted.to_bytes(),
            THUMBNAIL: staging.thumbnail(first, moving.camera, moving.background),
        }
    )
    if about.speech is not None:
        files[SPEECH] = head.read(SPEECH)
    if about.provenance.voice is not None:
        files[VOICE] = head.read(VOICE)
    notices = [b.read(LICENSES).decode() for b in (head, body) if LICENSES in b.manifest.files]
    if notices:
        files[LICENSES] = "\n\n".join(dict.fromkeys(notices)).encode()
    info = replace(
        about.head,
        num_gaussians=shown.num_gaussians,
        num_rest=0,
        fps=moving.head.fps,
        num_poses=len(poses),
        num_displacements=shown.num_displacements,
        gaze=gaze,
    )
    manifest = Manifest(
        name=about.name,
        head=info,
        body=None,
        speech=about.speech,
        camera=moving.camera,
        background=moving.background,
        persona=about.persona,
        loss=Loss(None, None, None),
        provenance=told_together(about.provenance, moving.provenance, look),
        skinned=tinted.info,
    )
    return write_bundle(out, *coarse_first(manifest, files))


def _gestures(bundle: Bundle, body: BakedSkinned, look: Look) -> dict[str, bytes]:
    """The file of gestures by its name, if the body has one."""
    if GESTURES not in bundle.manifest.files:
        return {}
    if look.build == MEDIUM:
        return {GESTURES: bundle.read(GESTURES)}
    return gestures_in(body, look.build, bundle.cuts)
