"""Checks the files of a DNA-Rendering recording without decoding pictures."""

from ico3d.capture.dna.calibration import Device
from ico3d.capture.finding import Finding
from ico3d.capture.smc.file import SmcFile
from ico3d.capture.smc.reader import examine_views


def examine_files(
    main: SmcFile, annotations: SmcFile, devices: list[Device], num_frames: int, faults: list[str]
) -> list[Finding]:
    """Missing or damaged pictures and annotations.

    Args:
        main: File with the pictures.
        annotations: File with the masks.
        devices: The cameras.
        num_frames: Number of frames that each camera should have.
        faults: Problems with the SMPL-X parameters, in words.
    """
    masked = bool(annotations.keys("Mask"))
    findings = [examine_views("views", main, {d.name: d.pictures for d in devices}, num_frames)]
    if masked:
        folders = {d.name: f"Mask/{d.number}/mask" for d in devices}
        findings.append(examine_views("mask files", annotations, folders, num_frames))
    fitted = bool(annotations.keys("SMPLx"))
    text = "; ".join(faults) or ("all frames" if fitted else "no body model parameters")
    findings.append(Finding("SMPL-X", "ok" if fitted and not faults else "warn", text))
    return findings
