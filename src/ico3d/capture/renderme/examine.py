"""Examining the files of a RenderMe-360 recording without decoding a picture."""

from collections.abc import Sequence

from ico3d.capture.finding import Finding
from ico3d.capture.smc.cameras import SmcCamera
from ico3d.capture.smc.file import SmcFile
from ico3d.capture.smc.reader import examine_views


def examine_files(
    raw: SmcFile,
    masks: SmcFile,
    cameras: Sequence[SmcCamera],
    num_frames: int,
    fitted: int,
    points: int,
) -> list[Finding]:
    """What is missing or damaged.

    Args:
        raw: Pictures.
        masks: The file with the masks.
        cameras: The cameras.
        num_frames: Frames each should have.
        fitted: Frames with a FLAME fit.
        points: Frames with landmarks in space.
    """
    folders = {camera.name: camera.pictures for camera in cameras}
    findings = [examine_views("views", raw, folders, num_frames)]
    matted = {name: mask_folder(name) for name in folders}
    if any(masks.keys(folder) for folder in matted.values()):
        findings.append(examine_views("mask files", masks, matted, num_frames))
    for what, count in (("FLAME", fitted), ("face in space", points)):
        text = "all frames" if count == num_frames else f"{count} of {num_frames} frames"
        level = "ok" if count == num_frames else "warn"
        findings.append(Finding(what, level, text if count else "none"))
    return findings


def mask_folder(name: str) -> str:
    """The group of a camera's mattes."""
    return f"Camera/{name}/mask"
