"""Makes an avatar from a trained head and a capture of the whole person."""

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch

from ico3d.avatar.avatar import (
    BODY,
    HEAD,
    PLACEMENT,
    Placement,
    TrainedAvatar,
    load_placement,
    save_placement,
)
from ico3d.avatar.joining.companion import SEAM, HeadSource
from ico3d.avatar.joining.cropping import cropped, near_border
from ico3d.avatar.joining.driving import head_poses, recorded_expressions
from ico3d.avatar.joining.face_views import face_views
from ico3d.avatar.joining.finding.found_placement import found_in_pictures
from ico3d.avatar.joining.relight import color_difference, relit
from ico3d.avatar.joining.seam_quality import largest_gap, seam_scores
from ico3d.avatar.joining.settings import JoiningSettings
from ico3d.avatar.joining.similarity import canonical_from_head, fit_in_words, moved
from ico3d.body.settings import BodySettings, Method
from ico3d.body.training.train_clip import BodyJob, Runner, train_body
from ico3d.capture.capture import Capture
from ico3d.capture.face.canonical import canonical_landmarks
from ico3d.capture.face.region import HeadRegion
from ico3d.capture.parts.held_out import training_part
from ico3d.capture.parts.trained_on import is_same_recording, trained_on
from ico3d.capture.pictures import train_cameras
from ico3d.common.device import DeviceName
from ico3d.common.files import resolved
from ico3d.errors import CaptureError, ModelError
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.device import computing_device
from ico3d.training.checkpoint import save_tensors
from ico3d.training.notes.lock import lets_go
from ico3d.training.run import RunFolder

SEAM_REACH = 0.012
"""Distance in metres to either side of the head's border; Gaussians within it mark the border."""
MEASURED = 60
"""Most pictures of test cameras in which the seam is measured."""


@dataclass(frozen=True)
class Assembly:
    """What an avatar is made from, and with which settings.

    Attributes:
        head: Folder of the trained head.
        joining: How the head is put on.
        body: How the body is trained.
        seed: Seed of all randomness.
        method: How the body's Gaussians are moved.
        continued: Folder of a body, trained without the head, from which training goes on.
        device: Where to compute; an interrupted run may go on with another one.
        hold_out: Whether the validation cameras are left out of colours and body.
    """

    head: Path
    joining: JoiningSettings
    body: BodySettings
    seed: int
    method: Method = "swings++"
    continued: Path | None = None
    device: DeviceName = "auto"
    hold_out: bool = False

    def about(self, capture: Path) -> dict:
        """Settings that a run must share with an interrupted one to continue it."""
        paths = {"head": str(resolved(self.head)), "capture": str(resolved(capture))}
        if self.continued:
            paths["continued"] = str(resolved(self.continued))
        held = {"hold_out": True} if self.hold_out else {}
        return (
            paths
            | held
            | {
                "seed": self.seed,
                "method": self.method,
                "joining": asdict(self.joining),
                "settings": asdict(self.body),
            }
        )


Say = Callable[[str], None]
"""Prints a sentence about what was found."""


def prepare(capture: Capture, folder: Path, assembly: Assembly, say: Say) -> RunFolder:
    """Opens the avatar's folder and, if that is not done yet, places the head in it.

    Args:
        capture: Recording of the whole person, with head poses.
        folder: The avatar's folder.
        assembly: Head, body and settings.
        say: Called with what was found.

    Raises:
        CaptureError: If the capture lacks something that is needed.
        ModelError: If the head does not fit.
        SettingsError: If the folder holds a run with other settings.
    """
    run = RunFolder(folder, assembly.about(capture.path))
    if not os.path.isfile(folder / SEAM):  # written last of the head's files
        place_head(capture, folder, assembly, say)
    return run


@lets_go
def assemble(
    capture: Capture, folder: Path, assembly: Assembly, say: Say, runner: Runner | None = None
) -> TrainedAvatar:
    """Makes an avatar, or goes on with an interrupted run of the same settings.

    Args:
        capture: Recording of the whole person, with head poses.
        folder: The avatar's folder.
        assembly: Head, body and settings.
        say: Called with what was found.
        runner: Trains the windows; by default one after another in this process.

    Raises:
        CaptureError: If the capture lacks something that is needed.
        ModelError: If the head does not fit.
        SettingsError: If the folder holds a run with other settings.
    """
    run = prepare(capture, folder, assembly, say)
    if run.finished() is not None:
        return TrainedAvatar.load(folder)
    source = HeadSource(resolved(folder), assembly.joining.border_points, assembly.joining.pruning)
    continued = assembly.continued and resolved(assembly.continued)
    given = (assembly.method, assembly.seed, assembly.body, source, continued, assembly.device)
    job = BodyJob(*given, assembly.hold_out)
    body = train_body(capture, folder / BODY, job, runner)
    placement, expressions = load_placement(folder / PLACEMENT)
    head = TrainedHead.load(folder / HEAD)
    summary = {
        "head": head.summary.get("capture", {}),
        "body": body.summary["capture"],
        "trained_on": [*head.records, *body.records],
        "settings": asdict(assembly.joining),
        "train_seconds": body.summary["train_seconds"],
    }
    avatar = TrainedAvatar.joined(head, body, placement, expressions, summary)
    avatar.to(computing_device(assembly.device))
    found = swaying(avatar, placement, say) | measured(avatar, capture, say)
    avatar = replace(avatar, summary=summary | found)
    avatar.save_summary(folder)  # head, placement and body are written already
    run.finish(avatar.summary)
    return avatar


def place_head(capture: Capture, folder: Path, assembly: Assembly, say: Say) -> None:
    """Aligns the head, crops it, matches its colours, and writes head, placement and seam.

    Args:
        capture: Recording of the whole person, with head poses.
        folder: The avatar's folder.
        assembly: Head and settings.
        say: Called with what was found.

    Raises:
        CaptureError: If the capture lacks something that is needed.
        ModelError: If the head does not fit.
    """
    device = computing_device(assembly.device)
    head, placement = TrainedHead.load(assembly.head), None
    if head.landmarks is None:
        head, placement = found_in_pictures(head, capture, assembly.head, say, device)
    else:
        say("face: where the landmarks of both recordings have it.")
    landmarks = _landmarks(head, assembly.head)
    region = HeadRegion.around(landmarks)
    placement = placement or align(capture, landmarks, say)
    seam = near_border(head, region, SEAM_REACH)
    head = cropped(head, region).to(device)
    expressions = recorded_expressions(head, capture, head.neutral())
    if assembly.joining.match_colors:
        if is_same_recording(head.summary.get("recording", {}), capture):
            say("colours: head and body are of one recording, so there is nothing to match.")
        else:
            _match_colors(head, capture, placement, expressions, assembly, say)
    (folder / HEAD).mkdir(parents=True, exist_ok=True)
    head.save(folder / HEAD)
    save_placement(folder / PLACEMENT, placement, expressions)
    save_tensors(folder / SEAM, {"seam": torch.from_numpy(seam)}, {})


def align(capture: Capture, landmarks: np.ndarray, say: Say) -> Placement:
    """Places a head in the world of the body's capture, by landmarks that both have.

    Args:
        capture: The body's recording.
        landmarks: (68, 3) landmarks of the head in the space of its model.
        say: Called with how well the landmarks fit.

    Raises:
        CaptureError: If the capture lacks head poses or landmarks of the face.
        ModelError: If the landmarks are no face.
    """
    poses = head_poses(capture)
    there = canonical_landmarks(capture)
    if there is None:
        raise CaptureError(
            f"{capture.path} has no landmarks of the face: find them with ico3d capture track."
        )
    matrix, rest = canonical_from_head(there, landmarks)
    say(fit_in_words(matrix, rest))
    return Placement(matrix, poses)


def swaying(avatar: TrainedAvatar, recorded: Placement, say: Say) -> dict:
    """How far a head fixed to its joint is from where it was recorded.

    Args:
        avatar: The avatar, whose placement is that of the joint.
        recorded: The placement that was recorded.
        say: Called with the distances in words.

    Returns:
        `sway_mm` and `sway_most_mm` for `avatar.json`: distance of the face's landmarks in
        millimetres, root mean square over the clip and in the worst frame; nothing where the head
        is not on a joint.
    """
    if avatar.placement.world_from_canonical is recorded.world_from_canonical:
        return {}
    face = moved(recorded.canonical_from_head, _landmarks(avatar.head, Path(HEAD)))  # (68, 3)
    both = (avatar.placement.world_from_canonical, recorded.world_from_canonical)
    hangs, was = (np.stack([moved(pose, face) for pose in poses]) for poses in both)  # (F, 68, 3)
    away = 1e3 * np.sqrt(np.square(hangs - was).sum(-1).mean(1))  # (F,)
    mean, most = float(np.sqrt(np.square(away).mean())), float(away.max())
    say(
        f"the head hangs on its joint: the face is within {mean:.1f} mm of where it was recorded, "
        f"{most:.1f} mm in the worst frame."
    )
    return {"sway_mm": round(mean, 2), "sway_most_mm": round(most, 2)}


def measured(avatar: TrainedAvatar, capture: Capture, say: Say) -> dict:
    """How well head and body fit together.

    Args:
        avatar: The avatar.
        capture: The body's recording; its test cameras measure, or its training cameras where it
            has none.
        say: Called with the figures in words.

    Returns:
        Figures for `avatar.json`: `gap_mm` (`largest_gap` in millimetres) and the fields of
        `SeamScores`; what cannot be measured is missing.
    """
    landmarks = _landmarks(avatar.head, Path(HEAD))
    region = HeadRegion.around(landmarks)
    found: dict = {}
    widest = largest_gap(avatar, region)
    if widest is None:
        say("head and body: nothing opaque lies at the head's border, so no gap can be measured.")
    else:
        found["gap_mm"] = round(1e3 * widest, 2)
        say(f"head and body: the widest gap is {found['gap_mm']:.1f} mm.")
    held_out = list(capture.split.test_cameras) or None
    try:
        views = face_views(capture, avatar.placement, region, landmarks, held_out, MEASURED)
        scores = seam_scores(avatar, views)
    except CaptureError as error:  # no camera in front: only the gap can be measured
        say(f"the seam in pictures is not measured: {error}")
        return found
    say(
        f"held-out pictures: PSNR of the face {scores.psnr_face:.1f} dB, about its border "
        f"{scores.psnr_border:.1f} dB, step of colour {scores.color_step:.4f}."
    )
    return found | {name: round(value, 4) for name, value in asdict(scores).items()}


def _match_colors(
    head: TrainedHead,
    capture: Capture,
    placement: Placement,
    expressions: np.ndarray,
    assembly: Assembly,
    say: Say,
) -> None:
    landmarks = _landmarks(head, assembly.head)
    recording, capture = capture, training_part(capture, assembly.hold_out)
    views = face_views(capture, placement, HeadRegion.around(landmarks), landmarks)
    before = color_difference(head.model, placement, expressions, views)
    head.model = relit(head.model, landmarks, placement, expressions, views)
    after = color_difference(head.model, placement, expressions, views)
    taught = trained_on(recording, train_cameras(capture), range(capture.num_frames))
    head.summary = head.summary | {"recoloured": taught}
    say(f"colours: the face differed by {before:.4f} from {len(views)} pictures, now {after:.4f}.")


def _landmarks(head: TrainedHead, folder: Path) -> np.ndarray:
    if head.landmarks is None:
        raise ModelError(
            f"{folder} does not say where the face of its head is: assemble the avatar again."
        )
    return head.landmarks
