"""Checks whether a capture is consistent, to find problems before training does."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ico3d.capture.capture import Capture
from ico3d.capture.checking import head
from ico3d.capture.checking.contact_sheet import contact_sheet
from ico3d.capture.finding import Finding
from ico3d.common.files import write_atomic
from ico3d.common.people.stated import NOT_STATED, is_stated
from ico3d.common.spread import spread
from ico3d.errors import CaptureError

SHOWN = 17
"""Number of pictures on the contact sheet, three rows together with the background."""
FASTEST = 15.0
"""Speed in metres per second that no joint of a person indoors exceeds."""
LOOKED_AT = 24
"""Number of frames whose pictures and masks are checked; poses and tables are checked in full."""


def examine(capture: Capture) -> list[Finding]:
    """Checks an open capture.

    Returns:
        One finding per check, in a fixed order.
    """
    checks: tuple[tuple[str, Callable[[Capture], Finding]], ...] = (
        ("split", _split),
        ("pictures", _pictures),
        ("masks", _masks),
        ("background", _background),
        ("poses", head.poses),
        ("motion", head.motion),
        ("landmarks", head.landmarks),
        ("expressions", head.expressions),
        ("sound", _sound),
        ("points", head.points),
        ("skeleton", _skeleton),
        ("provenance", _provenance),
    )
    findings = []
    for what, check in checks:
        try:
            findings.append(check(capture))
        except CaptureError as error:
            findings.append(Finding(what, "error", str(error)))
    try:
        return [*findings, *capture.inspect()]
    except CaptureError as error:
        return [*findings, Finding("files", "error", str(error))]


def sampled_views(capture: Capture, count: int) -> list[tuple[int, int]]:
    """Up to `count` (camera, frame) pairs with a picture, spread over frames and cameras."""
    frames = sorted({*capture.split.train, *capture.split.test})
    views = []
    for turn, index in enumerate(spread(len(frames), count)):
        cameras = np.roll(np.arange(len(capture.cameras)), -turn).tolist()
        # A capture may lack views: of each frame, the next camera that has one.
        seen = (c for c in cameras if capture.image(c, frames[index]) is not None)
        views += [(camera, frames[index]) for camera in seen][:1]
    return views


def _split(capture: Capture) -> Finding:
    """Frame numbers of training and test."""
    train, test = capture.split.train, capture.split.test
    cameras = capture.split.test_cameras
    text = f"{len(train)} frames train, {len(test)} test, of {capture.num_frames}"
    if cameras:
        names = ", ".join(capture.cameras[camera].name for camera in cameras)
        text = f"{len(train)} of {capture.num_frames} frames; these cameras test: {names}"
    both, every = set(train) & set(test), [*train, *test]
    if both:
        return Finding("split", "error", f"frame {min(both)} is in training and in test")
    if not train or min(every) < 0 or max(every) >= capture.num_frames:
        return Finding("split", "error", f"{text}: numbers lie outside the recording")
    left_out = capture.num_frames - len(every)
    note = f"; {left_out} frames are in neither" if left_out else ""
    return Finding("split", "ok" if (test or cameras) and not left_out else "warn", text + note)


def _pictures(capture: Capture) -> Finding:
    """Sizes and values of sampled pictures."""
    views = sampled_views(capture, LOOKED_AT)
    if not views:
        return Finding("pictures", "error", "no frame of the split has a picture")
    for camera, frame in views:
        image, lens = capture.image(camera, frame), capture.cameras[camera]
        if image is None or image.shape != (lens.height, lens.width, 3):
            shape = None if image is None else image.shape
            return Finding(
                "pictures",
                "error",
                f"camera {lens.name}, frame {frame}: shape {shape}, "
                f"expected {(lens.height, lens.width, 3)}",
            )
        if not np.isfinite(image).all() or image.std() < 1e-3:
            return Finding(
                "pictures", "error", f"camera {lens.name}, frame {frame} is blank or NaN"
            )
    sizes = sorted({f"{lens.width}x{lens.height}" for lens in capture.cameras})
    count = f"{len(capture.cameras)} camera{'s' if len(capture.cameras) > 1 else ''}"
    size = " and ".join(sizes) if len(sizes) < 4 else f"{len(sizes)} sizes"
    return Finding("pictures", "ok", f"{count}, {size}, {capture.fps:g} fps")


def _masks(capture: Capture) -> Finding:
    """Sampled masks: there, of the right size, neither empty nor everything."""
    shares, heads = [], []
    for camera, frame in sampled_views(capture, LOOKED_AT):
        mask, head = capture.mask(camera, frame), capture.head_mask(camera, frame)
        lens = capture.cameras[camera]
        where = f"camera {lens.name}, frame {frame}"
        if mask is None or head is None:
            return Finding("masks", "warn", f"{where} has no mask")
        if mask.shape != (lens.height, lens.width) or head.shape != mask.shape:
            return Finding("masks", "error", f"{where}: shape {mask.shape}")
        if not mask.any() or not head.any():
            return Finding("masks", "error", f"{where}: the mask is empty")
        shares.append(mask.mean())
        heads.append(head.mean())
    if not shares:
        return Finding("masks", "error", "there is no picture")
    text = f"person {np.mean(shares):.0%} of the picture"
    if capture.world_from_head(0) is not None:
        text += f", head {np.mean(heads):.0%}"
    # One camera sees a person of one size; several may stand near and far.
    unsteady = len(capture.cameras) == 1 and np.ptp(shares) > 0.5 * np.mean(shares)
    odd = np.mean(shares) > 0.95 or unsteady
    return Finding("masks", "warn" if odd else "ok", text + (", changes a lot" if odd else ""))


def _background(capture: Capture) -> Finding:
    """The plate and how well it matches what lies around the person."""
    plate = capture.background(0)
    if plate is None:
        return Finding("background", "warn", "no clean background")
    errors = []
    for _, frame in (v for v in sampled_views(capture, LOOKED_AT) if v[0] == 0):
        image, mask = capture.image(0, frame), capture.mask(0, frame)
        if image is None or mask is None:
            continue
        if image.shape != plate.shape:
            return Finding("background", "error", f"shape {plate.shape}, pictures {image.shape}")
        outside = mask < 0.01
        errors.append(np.abs(image - plate)[outside].mean() if outside.any() else 0.0)
    worst = max(errors, default=0.0)
    text = f"differs from what is around the person by {worst:.3f} at most"
    return Finding("background", "warn" if worst > 0.08 else "ok", text)


def _sound(capture: Capture) -> Finding:
    """Length of the sound against that of the pictures."""
    sound = capture.audio()
    if sound is None:
        return Finding("sound", "warn", "no sound: speech cannot drive a head trained on this")
    if sound.rate != 16_000 or sound.samples.ndim != 1 or not np.isfinite(sound.samples).all():
        return Finding("sound", "error", f"expected finite mono at 16 kHz, got {sound.rate} Hz")
    heard, seen = len(sound.samples) / sound.rate, capture.num_frames / capture.fps
    text = f"{heard:.2f} s for {seen:.2f} s of pictures"
    level = float(np.sqrt(np.mean(sound.samples**2))) if len(sound.samples) else 0.0
    if level < 1e-4:
        return Finding("sound", "warn", f"{text}, but silent")
    return Finding("sound", "warn" if abs(heard - seen) > 0.25 else "ok", text)


def _skeleton(capture: Capture) -> Finding:
    """Whether a body track is there, whole and steady."""
    track = capture.body_track()
    if track is None:
        return Finding("skeleton", "ok", "no body track; ico3d capture pose finds one")
    count, lost = len(track.rig), int((~track.fitted).sum())
    steps = np.linalg.norm(np.diff(track.joints(), axis=0), axis=-1) * capture.fps  # m/s
    text = f"{count} joints in {track.num_frames} frames, {lost} of them interpolated"
    if len(steps) and steps.max() > FASTEST:
        frame, joint = np.unravel_index(steps.argmax(), steps.shape)
        name = track.rig.names[int(joint)]
        return Finding(
            "skeleton", "warn", f"{text}; {name} moves at {steps.max():.0f} m/s in frame {frame}"
        )
    return Finding("skeleton", "warn" if 2 * lost > track.num_frames else "ok", text)


def _provenance(capture: Capture) -> Finding:
    """Whose likeness it is, consent and licence must be known before an avatar is baked."""
    known = capture.provenance
    asked = ("likeness", "consent", "licence")
    blank = [name for name in asked if not is_stated(known[name])]
    if blank:
        return Finding("provenance", "warn", f"{' and '.join(blank)} {NOT_STATED}")
    return Finding("provenance", "ok", "; ".join(known[name] for name in asked))


def report(capture: Capture, sheet: Path) -> None:
    """Prints the findings of `examine` and draws the contact sheet.

    Args:
        capture: An open capture.
        sheet: The PNG to write.

    Raises:
        CaptureError: If a finding is an error.
    """
    findings = examine(capture)
    title = Text(f"{capture.kind}: {capture.path}")
    table = Table("", "", "finding", title=title, title_justify="left")
    colours = {"ok": "green", "warn": "yellow", "error": "red"}
    for finding in findings:
        table.add_row(
            Text(finding.what), Text(finding.level, colours[finding.level]), Text(finding.text)
        )
    Console().print(table)
    wrong = [finding for finding in findings if finding.level == "error"]
    if wrong:
        more = f" (and {len(wrong) - 1} more)" if wrong[1:] else ""
        raise CaptureError(f"{capture.path}: {wrong[0].what}: {wrong[0].text.rstrip('.')}{more}.")
    drawn = contact_sheet(capture, sampled_views(capture, SHOWN))
    write_atomic(sheet, lambda path: drawn.save(path, format="PNG"))
    Console().print(Text(f"contact sheet: {sheet}"))
