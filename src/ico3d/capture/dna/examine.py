"""Examining the files of a DNA-Rendering recording without decoding a picture."""

from ico3d.capture.dna.calibration import Device
from ico3d.capture.dna.smc import SmcFile
from ico3d.capture.finding import Finding, missing_and_damaged

MAGICS = (b"\xff\xd8\xff", b"\x89PNG")


def examine_files(
    main: SmcFile, annotations: SmcFile, devices: list[Device], num_frames: int, faults: list[str]
) -> list[Finding]:
    """What is missing or damaged.

    Args:
        main: Pictures.
        annotations: Masks.
        devices: The cameras.
        num_frames: Frames each should have.
        faults: What is wrong with the SMPL-X parameters.
    """
    masked = bool(annotations.keys("Mask"))
    findings = [_views("views", main, {d.name: d.pictures for d in devices}, num_frames)]
    if masked:
        folders = {d.name: f"Mask/{d.number}/mask" for d in devices}
        findings.append(_views("mask files", annotations, folders, num_frames))
    fitted = bool(annotations.keys("SMPLx"))
    text = "; ".join(faults) or ("all frames" if fitted else "no body model parameters")
    findings.append(Finding("SMPL-X", "ok" if fitted and not faults else "warn", text))
    return findings


def _views(what: str, file: SmcFile, folders: dict[str, str], num_frames: int) -> Finding:
    """Whether every camera has every frame and each begins like a picture."""
    missing, damaged = [], []
    for name, folder in folders.items():
        there = set(file.keys(folder))
        for frame in range(num_frames):
            if str(frame) not in there:
                missing.append((name, frame))
            elif not file.head(f"{folder}/{frame}", 4).startswith(MAGICS):
                damaged.append((name, frame))
    return missing_and_damaged(what, len(folders) * num_frames, missing, damaged)
