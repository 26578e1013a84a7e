"""Opening and writing bundles (docs/bundle.md)."""

import hashlib
import struct
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.bundle import limits
from ico3d.bundle.animation import ANIMATION, Animation
from ico3d.bundle.archive import Archive, open_archive, write_zip
from ico3d.bundle.backdrop import BACKGROUNDS, check_background
from ico3d.bundle.graph.check import check_onnx
from ico3d.bundle.head import (
    HEAD,
    HEAD_REST,
    POSES,
    SHOULDERS,
    BakedHead,
    BakedShoulders,
    poses_from_bytes,
)
from ico3d.bundle.manifest import MANIFEST, FileEntry, Manifest, check_manifest
from ico3d.bundle.packaged import bundle_path
from ico3d.bundle.people.provenance import ClonedVoice
from ico3d.bundle.people.voice import VOICE, voice_from_bytes, voice_to_bytes
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.gestures import GESTURES, gestures_from
from ico3d.bundle.skinned.info import SKINNED, SKINNED_REST
from ico3d.bundle.windows.baked import BakedWindow
from ico3d.common.files import read_small
from ico3d.errors import BundleError
from ico3d.motion.clip import Clip
from ico3d.motion.recorded.cut import Cut

SPEECH = "speech.onnx"
THUMBNAIL = "thumbnail.png"
LICENSES = "LICENSES.txt"
FIRST_BYTES = 800_000
"""Size of what comes first of a large head, and of a large body on a skeleton."""


class Bundle:
    """An opened bundle that has passed every check of docs/bundle.md.

    Attributes:
        manifest: The manifest.
        head: The baked head, or None for a body alone.
        world_from_head: (F, 4, 4) float32 head poses at `manifest.head.fps`: on a body one for each
            frame of the body; without a body to be played back and forth; None without a head.
        shoulders: How the shoulders of a head alone stand while it sways; None where all follows
            the head.
        skinned: The body on a skeleton, or None.
        gestures: Gestures of the body on a skeleton besides the recorded motion, by name, or None.
        cuts: Frames of the recording that are gestures; empty where nobody says which.
        hung: Rotations (R, 4) by role of hanging arms; None without gestures.
        animation: Procedural motion of a whole person; None for a head or a body alone.
        voice: (256,) float32 tone colour of the voice that was cloned for the avatar, or None.
    """

    manifest: Manifest
    head: BakedHead | None
    world_from_head: np.ndarray | None
    shoulders: BakedShoulders | None
    skinned: BakedSkinned | None
    gestures: dict[str, Clip] | None
    cuts: tuple[Cut, ...]
    hung: np.ndarray | None
    animation: Animation | None
    voice: np.ndarray | None

    def __init__(self, archive: Archive):
        """Reads and checks every file; use `Bundle.open`.

        Raises:
            BundleError: If a check fails; the sentence names the file.
        """
        self._archive = archive
        if MANIFEST not in archive.sizes:
            raise BundleError(f"{MANIFEST}: is missing.")
        if archive.sizes[MANIFEST] > limits.MAX_MANIFEST_BYTES:
            raise BundleError(f"{MANIFEST}: is larger than {limits.MAX_MANIFEST_BYTES} bytes.")
        self._manifest_bytes = archive.read(MANIFEST)
        self.manifest = Manifest.from_json(self._manifest_bytes)
        _check_listing(self.manifest, archive)
        self._check_contents()

    @staticmethod
    def open(path: Path | str) -> "Bundle":
        """Opens a folder or an uncompressed zip and runs all checks; `demo` is the packaged bundle.

        Raises:
            BundleError: If the bundle is missing, damaged, unsafe or of an unknown version.
        """
        return Bundle(open_archive(bundle_path(path)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all files, the manifest first."""
        return (MANIFEST, *self.manifest.files)

    @property
    def background(self) -> str | None:
        """Name of the file with the background's Gaussians, or None."""
        return next((name for name in BACKGROUNDS if name in self.manifest.files), None)

    def read(self, name: str) -> bytes:
        """The content of a file; its hash is checked again at each call.

        Raises:
            BundleError: If the bundle has no such file, or the file has changed since opening.
        """
        if name == MANIFEST:
            return self._manifest_bytes
        entry = self.manifest.files.get(name)
        if entry is None:
            raise BundleError(f"the bundle has no file {name[:80]!r}.")
        data = self._archive.read(name)
        if hashlib.sha256(data).hexdigest() != entry.sha256:
            raise BundleError(f"{name}: its content does not match the manifest's hash.")
        return data

    def require_head(self) -> tuple[BakedHead, np.ndarray]:
        """The head and its poses (F, 4, 4).

        Raises:
            BundleError: If the bundle has no head.
        """
        if self.head is None or self.world_from_head is None:
            raise BundleError(f"the bundle of '{self.manifest.name}' has a body only, no head.")
        return self.head, self.world_from_head

    def window(self, index: int) -> BakedWindow:
        """The window `index` of the body.

        Raises:
            BundleError: If there is no such window, or its file has changed since opening.
        """
        body = self.manifest.body
        if body is None or not 0 <= index < len(body.windows):
            raise BundleError(f"the bundle has no window {index} of a body.")
        info = body.windows[index]
        return BakedWindow.from_bytes(self.read(info.file), body, info)

    def _check_contents(self) -> None:
        info = self.manifest.head
        self.head = self.world_from_head = self.shoulders = None
        if info is not None:
            rest = self.read(HEAD_REST) if info.num_rest else b""
            self.head = BakedHead.from_bytes(self.read(HEAD), info, rest)
            self.world_from_head = poses_from_bytes(self.read(POSES), info.num_poses)
            if SHOULDERS in self.manifest.files:
                self.shoulders = BakedShoulders.from_bytes(self.read(SHOULDERS), info)
        for index in range(len(self.manifest.body.windows) if self.manifest.body else 0):
            self.window(index)  # not kept: together they may be large
        self.skinned = self.gestures = self.animation = None
        self.cuts, self.hung = (), None
        if self.manifest.skinned is not None:
            rest = self.read(SKINNED_REST) if self.manifest.skinned.num_rest else b""
            self.skinned = BakedSkinned.from_bytes(self.read(SKINNED), self.manifest.skinned, rest)
            if GESTURES in self.manifest.files:
                found = gestures_from(self.read(GESTURES), self.skinned)
                self.gestures, self.cuts, self.hung = found.clips, found.cuts, found.hung
        if self.manifest.is_whole and self.manifest.any_body is not None:
            self.animation = Animation.from_bytes(self.read(ANIMATION))
            self.animation.check_body(self.manifest.any_body)
        if self.background is not None:
            check_background(self.read(self.background), self.background)
        _check_thumbnail(self.read(THUMBNAIL))
        if self.manifest.speech is not None:
            check_onnx(self.read(SPEECH), SPEECH, self.manifest.speech.input, "expression")
        if LICENSES in self.manifest.files:
            _check_text(self.read(LICENSES))
        cloned = self.manifest.provenance.voice
        self.voice = None if cloned is None else voice_from_bytes(self.read(VOICE))


def write_bundle(path: Path | str, manifest: Manifest, files: Mapping[str, bytes]) -> Manifest:
    """Writes a bundle as one uncompressed zip, atomically; equal parts give equal bytes.

    Args:
        path: The file, usually NAME.ico3d.
        manifest: The manifest; the field `files` is filled in here.
        files: Contents by name, without the manifest.

    Returns:
        The manifest as written.

    Raises:
        BundleError: If the manifest contradicts itself, or a name or size is not allowed.
    """
    entries = {
        name: FileEntry(hashlib.sha256(data).hexdigest(), len(data))
        for name, data in sorted(files.items())
    }
    written = replace(manifest, files=entries)
    check_manifest(written)
    _check_required(written)
    write_zip(Path(path), {MANIFEST: written.to_json(), **dict(sorted(files.items()))})
    return written


def coarse_first(
    manifest: Manifest, files: Mapping[str, bytes], most: int = FIRST_BYTES
) -> tuple[Manifest, dict[str, bytes]]:
    """Divides the files of a head and of a body on a skeleton that are large.

    Then a page shows somebody from the first Gaussians while the others are still coming.

    Args:
        manifest: The manifest. Gaussians must be sorted by importance.
        files: Contents by name.
        most: Size in bytes of first files. One that is larger by less than a half stays whole.

    Returns:
        The manifest with `num_rest`, and the files.
    """
    divided = dict(files)
    if manifest.head is not None:
        head = manifest.head
        first = _first_of(head.num_gaussians, len(files[HEAD]), most)
        if first < head.num_gaussians:
            baked = BakedHead.from_bytes(files[HEAD], head)
            divided[HEAD], divided[HEAD_REST] = baked.split(first)
            manifest = replace(manifest, head=replace(head, num_rest=head.num_gaussians - first))
    if manifest.skinned is not None:
        body = manifest.skinned
        first = _first_of(body.num_gaussians, len(files[SKINNED]), most)
        if first < body.num_gaussians:
            baked = BakedSkinned.from_bytes(files[SKINNED], body)
            divided[SKINNED], divided[SKINNED_REST] = baked.split(first)
            manifest = replace(manifest, skinned=replace(body, num_rest=body.num_gaussians - first))
    return manifest, divided


def _first_of(count: int, size: int, most: int) -> int:
    """Number of Gaussians in a first file of at most `most` bytes, of `count` in `size` bytes."""
    return count if size <= 1.5 * most else max(1, count * most // size)


def read_background(path: Path) -> dict[str, bytes]:
    """Reads a file of Gaussians for use as a bundle's background.

    Returns:
        One entry: the name in the bundle, and the content.

    Raises:
        BundleError: If the file cannot be read, or is neither SPZ nor PLY, or fails a check.
    """
    name = f"background{path.suffix.lower()}"
    if name not in BACKGROUNDS:
        raise BundleError(f"{path}: splats behind a person must be named .spz or .ply.")
    try:
        data = read_small(path, most=limits.MAX_BACKGROUND_BYTES)
    except OSError as error:
        raise BundleError(f"{path}: cannot be read ({error.strerror}).") from error
    check_background(data, name)
    return {name: data}


def add_files(path: Path, more: Mapping[str, bytes]) -> None:
    """Adds files to an existing bundle, or replaces files there.

    Args:
        path: The bundle.
        more: Contents by name.

    Raises:
        BundleError: If the bundle is damaged, or a file has no place in it.
    """
    bundle = Bundle.open(path)
    files = {name: bundle.read(name) for name in bundle.manifest.files}
    write_bundle(path, bundle.manifest, files | dict(more))


def give_voice(path: Path, voice: ClonedVoice, tone: np.ndarray, out: Path) -> None:
    """Writes a bundle once more, with a voice that was cloned for the avatar.

    Args:
        path: The bundle; what it has of another cloned voice is left out.
        voice: From which recording the voice is, and who agreed to it.
        tone: (256,) float32 tone colour.
        out: The bundle to write.

    Raises:
        BundleError: If the bundle is damaged, nobody agreed, or the tone colour is none.
    """
    bundle = Bundle.open(path)
    files = {name: bundle.read(name) for name in bundle.manifest.files}
    provenance = replace(bundle.manifest.provenance, voice=voice)
    manifest = replace(bundle.manifest, provenance=provenance)
    write_bundle(out, manifest, files | {VOICE: voice_to_bytes(tone)})


def _check_listing(manifest: Manifest, archive: Archive) -> None:
    """The files that are there must be just those the manifest lists, with their sizes."""
    _check_required(manifest)
    for name in archive.sizes:
        if name != MANIFEST and name not in manifest.files:
            raise BundleError(f"{name}: is not listed in the manifest.")
    for name, entry in manifest.files.items():
        if name not in archive.sizes or name == MANIFEST:
            raise BundleError(f"{name[:80]}: is listed in the manifest and missing.")
        if archive.sizes[name] != entry.size:
            raise BundleError(
                f"{name}: has {archive.sizes[name]} bytes, but the manifest says {entry.size}."
            )


def _check_required(manifest: Manifest) -> None:
    required = {THUMBNAIL}
    if manifest.speech:
        required |= {SPEECH}
    if manifest.head:
        required |= {HEAD, POSES} | ({HEAD_REST} if manifest.head.num_rest else set())
    if manifest.body:
        required |= {window.file for window in manifest.body.windows}
    if manifest.skinned:
        required |= {SKINNED} | ({SKINNED_REST} if manifest.skinned.num_rest else set())
    if manifest.is_whole:
        required |= {ANIMATION}
    if manifest.provenance.voice:
        required |= {VOICE}
    for name in sorted(required - set(manifest.files)):
        raise BundleError(f"{name}: is missing.")
    possible = {LICENSES, *BACKGROUNDS, *([GESTURES] if manifest.skinned else [])}
    if manifest.head and not manifest.any_body:
        possible |= {SHOULDERS}
    for name in manifest.files:
        if name not in required | possible:
            raise BundleError(f"{name[:80]}: does not belong into this bundle.")
    if set(BACKGROUNDS) <= set(manifest.files):
        raise BundleError(f"a bundle holds one of {' and '.join(BACKGROUNDS)}, not both.")


def _check_thumbnail(data: bytes) -> None:
    """Reads the size from the PNG header; the picture itself is decoded by the browser only."""
    if len(data) < 33 or data[:8] != b"\x89PNG\r\n\x1a\n" or data[12:16] != b"IHDR":
        raise BundleError(f"{THUMBNAIL}: is not a PNG picture.")
    width, height = struct.unpack_from(">II", data, 16)
    side = limits.MAX_THUMBNAIL_SIDE
    if not (1 <= width <= side and 1 <= height <= side):
        raise BundleError(f"{THUMBNAIL}: is {width}×{height}, larger than {side}×{side}.")


def _check_text(data: bytes) -> None:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise BundleError(f"{LICENSES}: is not UTF-8 text.") from error
