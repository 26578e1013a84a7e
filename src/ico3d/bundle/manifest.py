"""The manifest of a bundle (docs/bundle.md) as typed data."""

import json
import math
from dataclasses import dataclass, field
from typing import Any, cast

from ico3d.bundle import limits
from ico3d.bundle.people.provenance import (
    OPENVOICE,
    ClonedVoice,
    Provenance,
    check_texts,
    provenance_to_json,
    with_newer,
)
from ico3d.bundle.persona import (
    LONGEST_NAME,
    Persona,
    check_persona,
    with_defaults,
    without_defaults,
)
from ico3d.bundle.skinned.info import SkinnedInfo, check_skinned
from ico3d.bundle.windows.info import BodyInfo, check_body
from ico3d.common.expression import MOST_DISPLACEMENTS
from ico3d.common.people.stated import is_stated
from ico3d.common.typed import Rules, fill, parse_json, plain
from ico3d.errors import BundleError

FORMAT = "ico3d-bundle"
VERSION = 7
SINCE = {"body": 2, "skinned": 3}
"""Version in which a field appeared; in older manifests that field is read as null."""
SINCE_CASTERS = 4
"""Version in which a body on a skeleton got `num_casters`; older ones cast no shadow."""
SINCE_REST = 5
"""Version in which heads and bodies on a skeleton got `num_rest`; older ones are in one file."""
SINCE_DISPLACEMENTS = 6
"""Version in which heads got `num_displacements`; Gaussians of older ones stand still."""
SINCE_GAZE = 7
"""Version in which heads got `gaze`; eyes of older ones do not turn."""
OLDEST = 1
MANIFEST = "manifest.json"


@dataclass(frozen=True)
class FileEntry:
    """A file: SHA-256 in lower-case hexadecimal digits, and size in bytes."""

    sha256: str
    size: int


@dataclass(frozen=True)
class GazeInfo:
    """How the eyes of a head turn.

    The last two displacements of its Gaussians turn them, about +y (to the person's left) and about
    +x (downwards), `ico3d.common.expression.EYE_UNIT` metres per radian and unit.

    Attributes:
        eyes: Point between the centres of the eyeballs in canonical head space, metres.
        most: Largest angles to either side, and up or down, radians.
    """

    eyes: tuple[float, float, float]
    most: tuple[float, float]


@dataclass(frozen=True)
class HeadInfo:
    """The counts that the head's tensors must agree with.

    Attributes:
        num_gaussians: N, number of Gaussians.
        rank: K, number of basis vectors.
        hidden: H, width of the coefficient network.
        inputs: What drives the head: `speech` or `blendshapes`.
        expression_size: B, number of values of an expression.
        eye_offset: Index of the first of the seven eye and brow values
            (`ico3d.common.expression.EYE_NAMES`) in an expression; null for a head without them. A
            value after these seven is the smile.
        expression_names: Names of the B blendshapes; empty for speech.
        fps: Head poses per second; on a body the body's frame rate.
        num_poses: F, number of head poses; on a body one for each frame of the body.
        idle_expression: (B,) expression of the neutral face in silence with open eyes.
        num_rest: Number of the Gaussians in `head_rest.safetensors`, the least important ones; 0
            where all are in one file.
        num_displacements: M, number of ways in which Gaussians move with the expression, and with
            the gaze.
        gaze: How its eyes turn; null where they do not.
    """

    num_gaussians: int
    rank: int
    hidden: int
    inputs: str
    expression_size: int
    eye_offset: int | None
    expression_names: tuple[str, ...]
    fps: float
    num_poses: int
    idle_expression: tuple[float, ...]
    num_rest: int = 0
    num_displacements: int = 0
    gaze: GazeInfo | None = None


@dataclass(frozen=True)
class SpeechInfo:
    """How sound is turned into expressions.

    Attributes:
        encoder: Name of the speech encoder: small letters, digits and hyphens.
        sha256: SHA-256 of the encoder's weights, 64 hexadecimal digits.
        fps: Expression rows per second (25).
        input: Input of `speech.onnx`: `mel` (windows (T, 80, 16)) or `features` (T, D).
    """

    encoder: str
    sha256: str
    fps: float
    input: str


@dataclass(frozen=True)
class CameraInfo:
    """The visitor's first view: world space in metres, vertical field of view in degrees."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float]
    fov_y: float


@dataclass(frozen=True)
class Loss:
    """Quality lost by baking, on held-out pictures: PSNR in dB; null where not measured.

    For heads it is measured on whole pictures, for bodies and whole persons on the person.

    Attributes:
        psnr_exact: The trained model against the recording.
        psnr_baked: The baked model against the recording.
        psnr_baked_vs_exact: The baked model against pictures of the trained model.
    """

    psnr_exact: float | None
    psnr_baked: float | None
    psnr_baked_vs_exact: float | None


@dataclass(frozen=True)
class Manifest:
    """`manifest.json` of a head, a body, or both; `write_bundle` fills in `files`.

    A body is either one of windows (`body`) or one on a skeleton (`skinned`), never both.
    """

    name: str
    head: HeadInfo | None
    body: BodyInfo | None
    speech: SpeechInfo | None
    camera: CameraInfo
    background: tuple[float, float, float]
    persona: Persona
    loss: Loss
    provenance: Provenance
    skinned: SkinnedInfo | None = None
    files: dict[str, FileEntry] = field(default_factory=dict[str, FileEntry])
    format: str = FORMAT
    version: int = VERSION

    @property
    def is_whole(self) -> bool:
        """Whether the avatar is a whole person: a head on a body."""
        return self.head is not None and self.any_body is not None

    @property
    def any_body(self) -> BodyInfo | SkinnedInfo | None:
        """The body of either kind, or None."""
        return self.body or self.skinned

    def to_json(self) -> bytes:
        """The manifest as UTF-8 JSON; equal manifests give equal bytes."""
        value = {
            **plain(self),
            "persona": without_defaults(self.persona),
            "provenance": provenance_to_json(self.provenance),
        }
        return (json.dumps(value, indent=1, ensure_ascii=False) + "\n").encode()

    @staticmethod
    def from_json(data: bytes) -> "Manifest":
        """Parses and checks `manifest.json`.

        Raises:
            BundleError: If the data are no manifest of a known version, or contradict themselves.
        """
        if len(data) > limits.MAX_MANIFEST_BYTES:
            raise BundleError(f"{MANIFEST}: is larger than {limits.MAX_MANIFEST_BYTES} bytes.")
        value = parse_json(data, MANIFEST, BundleError)
        _check_version(value)
        if value["version"] < SINCE_REST:
            value |= {
                part: {"num_rest": 0, **value[part]}
                for part in ("head", "skinned")
                if isinstance(value.get(part), dict)
            }
        if value["version"] < SINCE_DISPLACEMENTS and isinstance(value.get("head"), dict):
            value |= {"head": {"num_displacements": 0, **value["head"]}}
        if value["version"] < SINCE_GAZE and isinstance(value.get("head"), dict):
            value |= {"head": {"gaze": None, **value["head"]}}
        missing = {name for name, since in SINCE.items() if value["version"] < since} - set(value)
        if value["version"] < SINCE_CASTERS and isinstance(value.get("skinned"), dict):
            value = {**value, "skinned": {"num_casters": 0, **value["skinned"]}}
        value = {**value, "version": VERSION, **dict.fromkeys(missing)}
        if "persona" in value:
            value = {**value, "persona": with_defaults(value["persona"])}
        if "provenance" in value:
            value = {**value, "provenance": with_newer(value["provenance"])}
        manifest = fill(Manifest, value, MANIFEST, Rules(BundleError))
        check_manifest(manifest)
        return manifest


def _check_version(value: Any) -> None:
    """The format comes first: a newer version has other fields."""
    known = cast(dict[str, Any], value) if isinstance(value, dict) else {}
    if known.get("format") != FORMAT:
        raise BundleError(f"{MANIFEST}: this is no ico3d bundle (format is not '{FORMAT}').")
    if known.get("version") not in range(OLDEST, VERSION + 1):
        raise BundleError(
            f"{MANIFEST}: this program reads bundles of versions {OLDEST} to {VERSION} only."
        )


def check_manifest(manifest: Manifest) -> None:
    """Checks that values are within their ranges and fit one another.

    Raises:
        BundleError: At the first invalid field, which the sentence names.
    """
    head, body = manifest.head, manifest.any_body
    _require(head is not None or body is not None, "head", "be there where no body is")
    once = manifest.body is None or manifest.skinned is None
    _require(once, "skinned", "be null where a body of windows is")
    if head is not None:
        _check_head(head)
    if manifest.body is not None:
        check_body(manifest.body, _require)
    if manifest.skinned is not None:
        check_skinned(manifest.skinned, _require)
    if head is not None and body is not None:
        _check_together(head, body)
    _check_speech(manifest)
    _check_camera(manifest.camera)
    _require(all(0 <= c <= 1 for c in manifest.background), "background", "lie between 0 and 1")
    _require(len(manifest.name) <= LONGEST_NAME, "name", f"have at most {LONGEST_NAME} letters")
    check_persona(manifest.persona, MANIFEST)
    check_texts(manifest.provenance)
    if manifest.provenance.voice is not None:
        _check_voice(manifest.provenance.voice)
    for name, entry in manifest.files.items():
        _check_file(name, entry)


def _check_head(head: HeadInfo) -> None:
    ranges = {
        "num_gaussians": limits.MAX_GAUSSIANS,
        "rank": limits.MAX_RANK,
        "hidden": limits.MAX_HIDDEN,
        "expression_size": limits.MAX_EXPRESSION_SIZE,
        "num_poses": limits.MAX_POSES,
    }
    for name, top in ranges.items():
        _require(1 <= getattr(head, name) <= top, f"head.{name}", f"lie between 1 and {top}")
    few = 0 <= head.num_displacements <= MOST_DISPLACEMENTS
    _require(few, "head.num_displacements", f"lie between 0 and {MOST_DISPLACEMENTS}")
    blended = head.num_gaussians * (head.rank + head.num_displacements)
    bounded = blended <= limits.MAX_BLENDED
    most = f"Gaussians × (rank + displacements) may be {limits.MAX_BLENDED}, not {blended}"
    _require(bounded, "head.rank", f"be less: {most}")
    inside = 0 <= head.num_rest < head.num_gaussians
    _require(inside, "head.num_rest", "be less than head.num_gaussians")
    _require(head.inputs in ("speech", "blendshapes"), "head.inputs", "be speech or blendshapes")
    _require(limits.MIN_FPS <= head.fps <= limits.MAX_FPS, "head.fps", limits.FPS_RANGE)
    size = head.expression_size
    _require(len(head.idle_expression) == size, "head.idle_expression", f"have {size} values")
    named = len(head.expression_names)
    _require(named in (0, size), "head.expression_names", f"be empty or have {size} names")
    eyes = head.eye_offset
    inside = eyes is None or 0 <= eyes <= size - 7
    _require(inside, "head.eye_offset", f"leave room for 7 of the {size} values")
    if head.gaze is not None:
        _check_gaze(head.gaze, head.num_displacements)


def _check_gaze(gaze: GazeInfo, displacements: int) -> None:
    turned = all(0 < most <= limits.MAX_EYE_TURN for most in gaze.most)
    _require(turned, "head.gaze.most", f"lie between 0 and {limits.MAX_EYE_TURN}")
    near = all(abs(value) <= 1 for value in gaze.eyes)
    _require(near, "head.gaze.eyes", "lie within a metre of the head")
    _require(displacements >= 2, "head.num_displacements", "count the two that turn the eyes")


def _check_together(head: HeadInfo, body: BodyInfo | SkinnedInfo) -> None:
    """A head on a body is placed frame by frame of the body."""
    _require(head.fps == body.fps, "head.fps", "be that of the body")
    frames = body.num_frames
    _require(head.num_poses == frames, "head.num_poses", f"be {frames}, one per frame of the body")


def _check_speech(manifest: Manifest) -> None:
    speech, head = manifest.speech, manifest.head
    driven = head is not None and head.inputs == "speech"
    _require(driven == (speech is not None), "speech", "be there just for heads driven by speech")
    if speech is not None:
        _require(speech.input in ("mel", "features"), "speech.input", "be mel or features")
        named = limits.ENCODER.fullmatch(speech.encoder)  # a file of this name is opened
        _require(named is not None, "speech.encoder", "be small letters, digits and hyphens")
        hashed = limits.SHA256.fullmatch(speech.sha256)
        _require(hashed is not None, "speech.sha256", "have 64 digits")
        _require(limits.MIN_FPS <= speech.fps <= limits.MAX_FPS, "speech.fps", limits.FPS_RANGE)
        _require(head is None or head.eye_offset == 32, "head.eye_offset", "be 32 for speech")


def _check_camera(camera: CameraInfo) -> None:
    _require(1 <= camera.fov_y <= 170, "camera.fov_y", "lie between 1 and 170 degrees")
    _require(camera.eye != camera.target, "camera.eye", "differ from the target")
    _require(any(camera.up), "camera.up", "have a length")
    for name in ("eye", "target", "up"):
        near = all(abs(x) <= limits.MAX_CAMERA_LENGTH for x in getattr(camera, name))
        _require(near, f"camera.{name}", f"be within {limits.MAX_CAMERA_LENGTH:g} m")
    ahead = [b - a for a, b in zip(camera.eye, camera.target, strict=True)]
    long, up = math.hypot(*ahead), math.hypot(*camera.up)
    _require(min(long, up) > 1e-6, "camera", "have an eye away from its target, and a long up")
    along = sum(a * b for a, b in zip(ahead, camera.up, strict=True)) / (long * up)
    _require(abs(along) < 1 - 1e-9, "camera.up", "point another way than the camera looks")


def _check_voice(voice: ClonedVoice) -> None:
    """Nobody's voice is imitated without a word from them."""
    where = "provenance.voice"
    _require(voice.engine == OPENVOICE, f"{where}.engine", f"be {OPENVOICE}")
    _require(is_stated(voice.consent), f"{where}.consent", "say that the voice's owner agreed")


def _check_file(name: str, entry: FileEntry) -> None:
    digits = set("0123456789abcdef")
    valid = len(entry.sha256) == 64 and set(entry.sha256) <= digits
    _require(valid, f"files[{name[:80]!r}].sha256", "be 64 lower-case hexadecimal digits")
    inside = 0 <= entry.size <= limits.MAX_FILE_BYTES
    _require(inside, f"files[{name[:80]!r}].size", f"be at most {limits.MAX_FILE_BYTES}")


def _require(holds: bool, where: str, what: str) -> None:
    if not holds:
        raise BundleError(f"{MANIFEST}: {where} must {what}.")
