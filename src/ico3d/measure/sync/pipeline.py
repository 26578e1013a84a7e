"""The pipeline of SyncNet: from pictures and sound to Sync-C, Sync-D and offset."""

import io
import logging
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from ico3d.capture.capture import Sound
from ico3d.capture.decoding import open_picture, to_bytes
from ico3d.capture.sound import mono
from ico3d.capture.video import open_video, read_sound
from ico3d.errors import CaptureError, MissingModelError
from ico3d.measure.sync.detectors import Detector, detector_on
from ico3d.measure.sync.mfcc import RATE, mfcc
from ico3d.measure.sync.network import COLUMNS, FRAMES, STRIDE, SyncNet, load_syncnet
from ico3d.measure.sync.score import SyncScores, scores_of
from ico3d.measure.sync.tracks import MORE_THAN, Crops, Track, tracks_of
from ico3d.splat.device import CPU

FPS = 25
"""Pictures per second that SyncNet was trained with."""
QUALITY = 95
"""Quality of the JPEG pictures that wait for their crop, as frames do in the published program."""
BATCH = 20
"""Windows of five frames that go through the network at a time."""
WIDEST = 1 << 14
"""Upper limit of the short side of videos in pixels: none is scaled down."""

log = logging.getLogger(__name__)


def sync_scores(
    frames: Iterable[np.ndarray], fps: float, sound: Sound, device: torch.device = CPU
) -> SyncScores:
    """Sync-C, Sync-D and offset of pictures and the sound that belongs to them.

    The steps of the published program (Chung and Zisserman 2016, `syncnet_python`): pictures at 25
    per second; faces by S3FD at a quarter of the size with a confidence above 0.9; a track of faces
    that overlap by half, with more than 100 detections and 100 pixels; crops around median-filtered
    boxes, 224 pixels wide; 13 MFCC of the sound; distances of their features at shifts of 15 frames
    to either side. Three steps differ: where S3FD's weights are absent MediaPipe finds the faces,
    which the result tells; cuts between shots are not looked for; crops are not encoded as XVID.
    Of several faces, the one that is there for longest is measured.

    Args:
        frames: uint8 RGB (H, W, 3), or floats in [0, 1]; all of one size.
        fps: Pictures per second.
        sound: The sound, from the time of the first picture on.
        device: Where to compute.

    Raises:
        MissingModelError: If SyncNet's weights are not installed, or those of every detector.
        ModelError: If a file does not hold the weights.
        CaptureError: If there is no face for long enough, or too little sound.
    """
    network = load_syncnet().to(device)
    with detector_on(device) as detector:
        pictures, faces = _looked_at(at_rate(frames, fps), detector)
    tracks = tracks_of(faces)
    if not tracks:
        raise CaptureError(
            f"no face of more than {MORE_THAN} pixels is there for more than {MORE_THAN} frames "
            f"of 1/{FPS} s ({sum(map(bool, map(len, faces)))} of {len(faces)} show one)."
        )
    longest = max(tracks, key=lambda track: len(track.boxes))
    return _scores(network, pictures, longest, sound, detector.name)


def sync_of_video(path: Path, sound: Sound | None = None, device: torch.device = CPU) -> SyncScores:
    """Sync-C, Sync-D and offset of a video file (see `sync_scores`).

    Args:
        path: The video.
        sound: Sound in place of that in the file, from the time of the first picture on.
        device: Where to compute.

    Raises:
        CaptureError: If the file cannot be read, has no sound, or shows no face for long enough.
        MissingModelError: If weights are not installed.
        ModelError: If a file does not hold the weights.
    """
    heard = read_sound(path) if sound is None else sound
    if heard is None:
        raise CaptureError(f"{path} has no sound to compare lips with.")
    return sync_scores(open_video(path, WIDEST).frames(FPS), FPS, heard, device)


def sync_or_none(
    frames: Iterable[np.ndarray], fps: float, sound: Sound, device: torch.device = CPU
) -> SyncScores | None:
    """What `sync_scores` returns; None, with a warning that says why, where it cannot measure."""
    try:
        return sync_scores(frames, fps, sound, device)
    except (MissingModelError, CaptureError) as error:
        log.warning("lip synchronisation is not measured: %s", error)
        return None


def at_rate(frames: Iterable[np.ndarray], fps: float) -> Iterator[np.ndarray]:
    """Pictures at 25 per second: number k is the one nearest to k / 25 s, the later of two."""
    count = 0
    for index, frame in enumerate(frames):
        while int(count * fps / FPS + 0.5) == index:
            yield frame
            count += 1


def _looked_at(
    frames: Iterable[np.ndarray], detector: Detector
) -> tuple[list[bytes], list[np.ndarray]]:
    """Each picture as JPEG, and the boxes of its faces."""
    pictures, faces = [], []
    for frame in frames:
        if frame.dtype != np.uint8:
            frame = to_bytes(np.clip(frame, 0, 1))
        target = io.BytesIO()
        Image.fromarray(frame).save(target, "JPEG", quality=QUALITY, subsampling=0)
        pictures.append(target.getvalue())
        faces.append(detector.boxes(np.ascontiguousarray(frame)))
    return pictures, faces


def _scores(
    network: SyncNet, pictures: Sequence[bytes], track: Track, sound: Sound, detector: str
) -> SyncScores:
    """Scores of one track."""
    heard = mono(sound.samples, sound.rate, RATE).samples
    per_frame = RATE // FPS
    heard = heard[track.first * per_frame : track.stop * per_frame]
    count = min(len(track.boxes), len(heard) // per_frame) - FRAMES
    if count < 1:
        raise CaptureError(f"only {len(heard) / RATE:.2f} s of sound belong to the face.")
    crops = Crops(track)
    face = (
        crops.cut(np.asarray(open_picture(pictures[track.first + place], "a face")), place)
        for place in range(count + FRAMES - 1)
    )
    samples = np.clip(heard * 32768, -32768, 32767).round().astype(np.int16)
    lips = lip_features(network, face)
    return scores_of(
        lips, sound_features(network, mfcc(samples), count), len(track.boxes), detector
    )


@torch.no_grad()
def lip_features(network: SyncNet, faces: Iterable[np.ndarray]) -> Tensor:
    """Features (T, 1024) of T + 4 pictures uint8 RGB (224, 224, 3) of a face, on the CPU."""
    device = next(network.parameters()).device
    found, clip = [], []

    def watched() -> Tensor:
        batch = np.stack(clip)[..., ::-1].astype(np.float32)  # (N + 4, 224, 224, 3) BGR
        return network.watch(torch.from_numpy(batch).to(device)).cpu()  # (N, 1024)

    for face in faces:
        clip.append(face)
        if len(clip) == BATCH + FRAMES - 1:
            found.append(watched())
            clip = clip[BATCH:]
    if len(clip) >= FRAMES:
        found.append(watched())
    return torch.cat(found)


@torch.no_grad()
def sound_features(network: SyncNet, rows: np.ndarray, count: int) -> Tensor:
    """Features (count, 1024) of MFCC (R, 13), one row for each frame, on the CPU."""
    device = next(network.parameters()).device
    starts = np.arange(count)[:, None] * STRIDE + np.arange(COLUMNS)  # (count, 20)
    pieces = torch.from_numpy(rows[starts].transpose(0, 2, 1).astype(np.float32))  # (count, 13, 20)
    return torch.cat([network.hear(part.to(device)).cpu() for part in pieces.split(BATCH)])
