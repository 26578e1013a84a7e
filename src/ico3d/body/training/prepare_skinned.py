"""The beginning of a skinned body's training: Gaussians on the template's surface at rest."""

import numpy as np
import torch
from torch import Tensor

from ico3d.body.companion import MOMENTS, MOST, Companion
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.body.settings import BodySettings
from ico3d.body.skinning.casters import caster_tensors, spread_casters
from ico3d.body.skinning.coefficients import initial_network
from ico3d.body.skinning.light import LIGHTS
from ico3d.body.skinning.skinned import NETWORK, Skinned
from ico3d.body.skinning.template import Skin, hung_logits, sampled
from ico3d.body.training.begin import Begin, round_gaussians, trespassing
from ico3d.body.training.find_lamp import find_lighting
from ico3d.body.training.standing_off import standing_off
from ico3d.body.training.surface_points import initial_points
from ico3d.capture.capture import Capture
from ico3d.capture.pictures import train_cameras
from ico3d.capture.surface.coverage import HIDING, visible
from ico3d.errors import CaptureError
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.rig import Rig
from ico3d.splat.initial import spacing

SPARE = 3
"""Factor by which more points are drawn than wanted, as those that no camera sees are left out."""
DENSER, SHORT, MOST_DENSE = 1.5, 0.12, 5.0
"""Points per area grow with this power of the pixels per metre of the pictures, and with the
inverse of the length of a bone where that is shorter than `SHORT` metres, up to a factor. Jeans
that are seen from afar had four tenths of all Gaussians, hands a twelfth."""
SURFACE = 10_000
"""Points of the recorded surface, among which those off the skin are looked for."""


def begin_skinned(
    capture: Capture,
    window: Window,
    settings: BodySettings,
    rng: np.random.Generator,
    companion: Companion | None = None,
) -> Begin:
    """Round Gaussians on the skin that cameras see, and on clothes and hair that stand off it.

    Args:
        capture: The recording, with a body track.
        window: Frames whose poses are trained.
        settings: Number of Gaussians, residual shapes and light.
        rng: Draws the points.
        companion: Other Gaussians, whose space stays empty and near whose border more points begin;
            None for none.

    Raises:
        CaptureError: If there is no body track, or it lies outside of all pictures.
    """
    track = tracked(capture)
    count = min(settings.initial.gaussians, settings.density.max_gaussians)
    skin, fine = _seen(sampled(track, SPARE * count, rng), track, capture, window)
    skin = _dressed(skin, fine, track, capture, window, count, settings, rng)
    if companion is not None:
        skin = _beside(companion, skin, track, window, rng)
    places = skin.posed(track, window.center)  # (P, 3)
    generator = torch.Generator().manual_seed(int(rng.integers(2**62)))
    motion, shared = _motion(track, window, settings, generator)
    gaussians = round_gaussians(capture, (window.center,), [places], settings)
    gaussians["means"] = torch.from_numpy(skin.points).float()
    gaussians |= _hung(skin, motion)
    if motion.shadow:
        shared |= _lamp_and_casters(capture, track, window)
        values = {**gaussians, **shared}
        pose = motion.pose_at(values, window.tau(window.center))
        gaussians["color_logits"] = gaussians["color_logits"] - motion.lighting(values, pose)
    extent = float(np.ptp(skin.points, axis=0).max() / 2)
    return Begin(WindowModel(motion, gaussians, shared), extent, f"the skin of {track.source}")


def tracked(capture: Capture) -> BodyTrack:
    """The body track of a capture.

    Raises:
        CaptureError: If the capture has none.
    """
    track = capture.body_track()
    if track is None:
        raise CaptureError(
            f"{capture.path} has no body track, which --method skinned needs: make one with "
            f"ico3d capture pose {capture.path}, or train with --method swings++, which needs none."
        )
    return track


def _seen(
    skin: Skin, track: BodyTrack, capture: Capture, window: Window
) -> tuple[Skin, np.ndarray]:
    """The points that some training camera sees at one of several frames, and how finely, (P,).

    Several frames are tested, as arms hide what is under them. Fineness is in pixels per metre, the
    root mean square of the pictures that show a point; what lies beside all of them counts as the
    coarsest.

    Raises:
        CaptureError: If no point is seen.
    """
    cameras = [capture.cameras[index] for index in train_cameras(capture)]
    seen, views, squares = np.zeros(len(skin), bool), *np.zeros((2, len(skin)))
    for frame in window.moments(MOMENTS):
        places = skin.posed(track, frame)  # (P, 3)
        gap = HIDING * float(np.median(spacing(places)))
        for camera in cameras:
            shown = visible(places, camera, gap)  # (P,)
            seen |= shown
            pixels, depths = camera.project(places)  # (P, 2), (P,)
            inside = (pixels >= 0) & (pixels <= (camera.width, camera.height))
            shown &= inside.all(axis=1)
            views[shown] += 1
            squares[shown] += (camera.intrinsics[0, 0] / depths[shown]) ** 2
    if not seen.any():
        raise CaptureError(
            f"{capture.path}: the body track lies outside of all pictures: "
            "delete it and run ico3d capture pose again."
        )
    fine = np.sqrt(squares / np.maximum(views, 1))
    coarsest = fine[views > 0].min() if views.any() else 1.0
    return skin[seen], np.maximum(fine, coarsest)[seen]


def _beside(
    companion: Companion, skin: Skin, track: BodyTrack, window: Window, rng: np.random.Generator
) -> Skin:
    """The points, and points near the companion's border, without those that trespass mostly."""
    frame = window.center
    border = skin.pulled_back(companion.border(frame, rng), track, frame)
    both, frames = Skin.joined(skin, border), window.moments(MOMENTS)
    times = [trespassing(companion, both.posed(track, frame), frame) for frame in frames]
    return both[np.sum(times, 0) < min(MOST, len(frames))]


def _dressed(
    skin: Skin,
    fine: np.ndarray,
    track: BodyTrack,
    capture: Capture,
    window: Window,
    count: int,
    settings: BodySettings,
    rng: np.random.Generator,
) -> Skin:
    """`count` points of the skin and of what stands off it, in proportion to their surfaces.

    Those of the skin are the denser the finer (P,) pictures show it, and the shorter its bones are.
    """
    frame, others = window.center, sorted({window.first, window.last})
    start = initial_points(capture, frame, SURFACE, rng, settings.initial.source)
    off = standing_off(skin, track, capture, start.points, frame, others)
    beside = min(round(count * len(off) / SURFACE), len(off))
    dense = fine**DENSER * detail(skin.binding, track.rig)
    return Skin.joined(_some(off, beside, rng), _some(skin, count - beside, rng, dense))


def detail(binding: Binding, rig: Rig) -> np.ndarray:
    """(P,) how much denser points are where bones are short, as those of fingers."""
    parents = np.array(rig.parents)
    below = np.flatnonzero(parents >= 0)
    length = np.linalg.norm(rig.joints[below] - rig.joints[parents[below]], axis=1)
    longest = np.zeros(len(rig))
    np.maximum.at(longest, parents[below], length)
    ends = np.setdiff1d(below, parents)  # those that carry no other bone
    longest[ends] = length[np.searchsorted(below, ends)]
    factor = np.clip(SHORT / np.maximum(longest, 1e-6), 1, MOST_DENSE)  # (J,)
    return (factor[binding.joints] * binding.weights).sum(1) / binding.weights.sum(1)


def _some(
    skin: Skin, count: int, rng: np.random.Generator, weights: np.ndarray | None = None
) -> Skin:
    """At most `count` of the points, chosen at random, in proportion to weights (P,) if given."""
    if len(skin) <= count:
        return skin
    share = None if weights is None else weights / weights.sum()
    return skin[np.sort(rng.choice(len(skin), count, replace=False, p=share))]


def _motion(
    track: BodyTrack, window: Window, settings: BodySettings, generator: torch.Generator
) -> tuple[Skinned, dict[str, Tensor]]:
    """The motion, and its shared tensors with the poses of the body track."""
    sizes, rig, frames = settings.skinning, track.rig, slice(window.first, window.last + 1)
    lit = sizes.light, sizes.light and sizes.shadow
    motion = Skinned(rig.names, rig.parents, len(window), sizes.shapes, sizes.hidden, *lit)
    shared = {
        "rig_joints": torch.from_numpy(rig.joints).float(),
        "pose_rotations": torch.from_numpy(track.rotations[frames]).float().clone(),
        "pose_roots": torch.from_numpy(track.roots[frames]).float().clone(),
    }
    if motion.light:
        shared["light"] = torch.zeros(LIGHTS, 3)
    if motion.shapes:
        network = initial_network(shared["pose_rotations"], motion.hidden, motion.shapes, generator)
        shared |= {NETWORK + layer: value for layer, value in network.items()}
    return motion, shared


def _lamp_and_casters(capture: Capture, track: BodyTrack, window: Window) -> dict[str, Tensor]:
    """How the person is lit, as pictures tell, and what casts shadows."""
    casters = caster_tensors(spread_casters(track))
    found = find_lighting(capture, track, window, casters)
    lamp = {"lamp_direction": found.direction, "lamp_strength": found.strength}
    return {"light": found.light, **lamp, **casters}


def _hung(skin: Skin, motion: Skinned) -> dict[str, Tensor]:
    """The motion's tensors of the Gaussians, with residual shapes that are 0."""
    binding = skin.binding
    tensors = {
        "skin_joints": torch.from_numpy(binding.joints.astype(np.int32)),
        "skin_logits": hung_logits(binding),
    }
    if motion.light:
        tensors["normals"] = torch.from_numpy(skin.normals).float()
    if motion.shapes:
        shape = len(skin), 3, motion.shapes
        tensors |= {"shape_means": torch.zeros(shape), "shape_colors": torch.zeros(shape)}
    return tensors
