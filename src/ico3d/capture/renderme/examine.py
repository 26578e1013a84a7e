"""Checks the files of a RenderMe-360 recording without decoding pictures."""

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
    """Missing or damaged pictures and annotations.

    Args:
        raw: File with the pictures.
        masks: File with the masks.
        cameras: The cameras.
        num_frames: Number of frames that each camera should have.
        fitted: Number of frames with a FLAME fit.
        points: Number of frames with 3D landmarks.
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
    """Path of the group with a camera's masks."""
    return f"Camera/{name}/mask"
