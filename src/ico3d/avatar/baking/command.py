"""The verb `ico3d bake`."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import tyro

from ico3d.avatar.baking.telling.statement import Statement
from ico3d.common.device import DeviceName
from ico3d.common.files import read_small, write_atomic

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import torch

    from ico3d.avatar.avatar import TrainedAvatar
    from ico3d.avatar.baking.body_bundle import BodyParts, WindowResult
    from ico3d.avatar.baking.body_cost import HeadAt
    from ico3d.avatar.baking.telling.about import About
    from ico3d.body.model_folder import TrainedBody
    from ico3d.bundle.animation import Animation
    from ico3d.bundle.manifest import Loss, Persona
    from ico3d.capture.capture import Capture
    from ico3d.head.model_folder import TrainedHead
    from ico3d.motion.recorded.cut import Cut

Report = Callable[[str], None]
"""Prints a line about the progress."""


@dataclass(frozen=True)
class Bake:
    """Makes the bundle that browsers play, and measures what baking costs on test pictures.

    Attributes:
        model: A model folder of ico3d train head, ico3d train body or ico3d assemble.
        files: The recordings of the model, and the bundle to write, NAME.ico3d. A head: CAPTURE
            OUT. A body: [CAPTURE] OUT. A whole person: [HEAD_CAPTURE [BODY_CAPTURE]] OUT. Without
            the body's capture, a body is measured against the exact model only; without the head's
            capture, the face's expressions come from synthetic voices.
        rank: Number of basis vectors of a head, 1 to 64; by default the smallest from 16 on that
            keeps the bounds: at most 0.3 dB lost against ground truth, at least 45 dB against the
            exact model, at most 1.7 MB per 10,000 Gaussians. Bodies have bounds of their own: at
            most 0.1 dB lost; bodies of windows at most 110 bytes per Gaussian and window. Whole
            persons also may lose 0.3 dB at most.
        name: The avatar's name; by default the persona's name, of a body without a persona the
            file name of the bundle.
        persona: TOML or JSON file that says who the avatar is; for heads and whole persons, by
            default that of the package.
        licences: Text files with notices that the sources ask for; they go into LICENSES.txt.
        background: Splats that stand behind the person, in the same world: .spz or .ply.
        strip: Also write a picture to this file: recorded | exact | baked.
        force: Write the bundle although it breaks a bound, and play motion that looks bad.
        device: Where to compute: by default with CUDA where that works, else on the CPU.
        statement: What only people can say of the avatar.
    """

    model: tyro.conf.Positional[Path]
    files: Annotated[
        tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="[CAPTURE ...] OUT")
    ]
    rank: int | None = None
    name: str | None = None
    persona: Path | None = None
    licences: tuple[Path, ...] = ()
    background: Path | None = None
    strip: Path | None = None
    force: bool = False
    device: DeviceName = "auto"
    statement: Annotated[Statement, tyro.conf.arg(name="")] = field(default_factory=Statement)

    def run(self) -> None:
        """Bakes, measures, writes and checks the bundle.

        Raises:
            BundleError: If loss or size break a bound and `force` is not set.
            CaptureError: If a capture does not fit the model.
            ModelError: If the folder holds nothing that can be baked.
            SettingsError: If the options do not fit the model, or nobody says whose likeness the
                avatar is, who agreed and who makes it.
        """
        from rich.console import Console

        from ico3d.avatar.avatar import TrainedAvatar
        from ico3d.avatar.models import open_model
        from ico3d.body.model_folder import TrainedBody
        from ico3d.bundle.format import Bundle, add_files, read_background
        from ico3d.head.model_folder import TrainedHead

        console = Console()
        model = open_model(self.model, TrainedHead, TrainedBody, TrainedAvatar)
        by_kind = {TrainedHead: (2, 2), TrainedBody: (1, 2), TrainedAvatar: (1, 3)}
        least, most = by_kind[type(model)]
        if not least <= len(self.files) <= most:
            self._refuse(
                "ico3d bake needs HEAD CAPTURE OUT, BODY [CAPTURE] OUT, or "
                "AVATAR [HEAD_CAPTURE [BODY_CAPTURE]] OUT."
            )
        behind = read_background(self.background) if self.background else {}
        model.to(self._place)
        if isinstance(model, TrainedAvatar):
            self._bake_whole(model, console.print)
        elif isinstance(model, TrainedBody):
            self._bake_body(model, console.print)
        else:
            self._bake_head(model, console.print)
        if behind:
            add_files(self._out, behind)
        Bundle.open(self._out)
        console.print(f"{self._out}: {self._out.stat().st_size / 1e6:.2f} MB.")

    @property
    def _out(self) -> Path:
        return self.files[-1]

    @property
    def _place(self) -> "torch.device":
        from ico3d.splat.device import computing_device

        return computing_device(self.device)

    def _bake_head(self, head: "TrainedHead", report: Report) -> None:
        from ico3d.avatar import staging
        from ico3d.avatar.baking import head_bundle, head_cost
        from ico3d.avatar.baking.flat import colors, cost
        from ico3d.avatar.baking.samples import recorded_samples
        from ico3d.capture.formats import open_capture
        from ico3d.capture.parts.head_of_body import head_in

        self._check_rank()
        capture = head_in(open_capture(self.files[0]))
        about = self._about(self._persona(), {str(capture.path): capture.provenance})
        neutral = staging.background_colour(capture, 0)
        views = head_cost.references(head, capture, neutral, head_bundle.MEASURED_VIEWS)
        if head.model.shape.sh_degree:
            track = head.track(capture)
            shown = [track.at(frame).detach() for frame in capture.split.train]
            exact, head = views, colors.flat_head(head, capture, shown)
            report(_flattened("the head", cost.head_loss(head, exact)))
            views = head_cost.references(head, capture, neutral, head_bundle.MEASURED_VIEWS)
        samples = recorded_samples(head, capture)
        result = head_bundle.bake(head, views, samples, self.rank, report)
        if self.strip:
            _save_picture(head_cost.strip(result.head, views), self.strip)
        if not self.force:
            head_bundle.check(result)
        manifest = head_bundle.write(self._out, result, samples, head, capture, about)
        report(head_bundle.eyes_in_words(manifest))

    def _bake_body(self, body: "TrainedBody", report: Report) -> None:
        from ico3d.avatar.baking import body_bundle
        from ico3d.avatar.recorded import read_cuts

        if self.rank is not None:
            self._refuse("--rank is for heads: what a body keeps is chosen window by window.")
        capture = self._capture(0)
        known = body.summary.get("capture") or (capture.provenance if capture else {})
        about = self._about(self._body_persona(), {"the body's recording": known})
        body = _flat_body(body, capture, report)
        parts, check = _baked(body, capture, None, read_cuts(self.model, body), report)
        if self.strip:
            _save_picture(body_bundle.strip(body, parts.baked, capture), self.strip)
        if not self.force:
            check()
        body_bundle.write(self._out, parts, capture, about)

    def _bake_whole(self, avatar: "TrainedAvatar", report: Report) -> None:
        from ico3d.avatar.baking import head_bundle, head_cost, person_bundle
        from ico3d.avatar.recorded import read_cuts

        self._check_rank()
        parts = {"the head's recording": avatar.head, "the body's recording": avatar.body}
        known = {where: part.summary.get("capture", {}) for where, part in parts.items()}
        about = self._about(self._persona(), known)
        animation = person_bundle.animation_of(self.model, avatar)
        head_capture, body_capture = self._capture(0), self._capture(1)
        avatar = _flat_avatar(avatar, head_capture, body_capture, report)
        samples, views = person_bundle.head_samples(avatar, head_capture, about.persona)
        head = head_bundle.bake(avatar.head, views, samples, self.rank, report)
        head_at = person_bundle.head_at(avatar)
        cuts = read_cuts(self.model, avatar.body)
        body, check = _baked(avatar.body, body_capture, head_at, cuts, report)
        baked = (head.head, body, samples.expressions)
        result = person_bundle.put_together(avatar, *baked, body_capture)
        report(f"the whole person: {head_cost.in_words(result.loss)}.")
        if self.strip:
            _save_picture(person_bundle.strip(avatar, result.person, body_capture), self.strip)
        animation = person_bundle.with_quality(animation, avatar, result.person, body_capture)
        if not self.force:
            head_bundle.check(head)
            check()
            person_bundle.check(result)
            animation = _played(animation, report)
        manifest = person_bundle.write(self._out, avatar, result, animation, body_capture, about)
        report(head_bundle.eyes_in_words(manifest))

    def _capture(self, index: int) -> "Capture | None":
        """Opens capture `index` of `files`, the last of which is the bundle; None if not given."""
        from ico3d.capture.formats import open_capture

        return open_capture(self.files[index]) if index < len(self.files) - 1 else None

    def _check_rank(self) -> None:
        from ico3d.bundle.limits import MAX_RANK

        if self.rank is not None and not 1 <= self.rank <= MAX_RANK:
            self._refuse(f"--rank must lie between 1 and {MAX_RANK}, not {self.rank}.")

    def _about(self, persona: "Persona", parts: "Mapping[str, Mapping]") -> "About":
        """What the bundle tells besides what it shows.

        Args:
            persona: Who the avatar is.
            parts: What the recordings state, by what they are called in errors.
        """
        from ico3d.avatar.baking.telling.about import About, provenance_of

        provenance = provenance_of(parts, self.statement, self._out)
        return About(self.name or persona.name, persona, provenance, self._notices())

    def _persona(self) -> "Persona":
        from ico3d.avatar.baking.persona import load_persona

        return load_persona(self.persona)

    def _body_persona(self) -> "Persona":
        """The persona of --persona; by default one with a name only, as bodies do not talk."""
        from dataclasses import replace

        from ico3d.bundle.manifest import Persona

        persona = self._persona() if self.persona else Persona(self._out.stem, "", ())
        return replace(persona, name=self.name or persona.name)

    def _notices(self) -> str:
        try:
            return "\n\n".join(read_small(path).decode("utf-8").strip() for path in self.licences)
        except (OSError, UnicodeDecodeError) as error:
            self._refuse(f"a notice of --licences cannot be read: {error}.")

    @staticmethod
    def _refuse(sentence: str) -> NoReturn:
        from ico3d.errors import SettingsError

        raise SettingsError(sentence)


def _flat_body(body: "TrainedBody", capture: "Capture | None", report: Report) -> "TrainedBody":
    """The body with colours that do not depend on the view; reports what that costs."""
    from functools import partial

    from ico3d.avatar.baking.body_bundle import seen_box
    from ico3d.avatar.baking.body_cost import ring_of_cameras
    from ico3d.avatar.baking.flat import colors, cost

    if not colors.depends_on_view(body):
        return body
    around = ring_of_cameras(*seen_box(partial(body.window_gaussians, 0)), count=8)
    flat = colors.flat_body(body, colors.seeing_cameras(capture) if capture else around)
    report(_flattened("the body", cost.body_loss(body, flat, capture, around)))
    return flat


def _flat_avatar(
    avatar: "TrainedAvatar",
    head_capture: "Capture | None",
    body_capture: "Capture | None",
    report: Report,
) -> "TrainedAvatar":
    """The person with colours that do not depend on the view; reports what that costs."""
    from dataclasses import replace

    import torch

    from ico3d.avatar.baking.flat import colors, cost
    from ico3d.avatar.baking.samples import references_around

    head, shown = avatar.head, [torch.from_numpy(row) for row in avatar.expressions]
    flat = colors.flat_head(head, head_capture, shown)
    if flat is not head:
        views = references_around(head, avatar.expressions, colors.PROBES)
        report(_flattened("the head", cost.head_loss(flat, views)))
    return replace(avatar, head=flat, body=_flat_body(avatar.body, body_capture, report))


def _flattened(what: str, loss: "Loss") -> str:
    """A line about what it costs that colours do not depend on the view."""
    from ico3d.avatar.baking.head_cost import in_words

    return f"{what} without view-dependent colours: {in_words(loss)}."


def _played(animation: "Animation", report: Report) -> "Animation":
    """The animation without motion that looks far worse than the rest of the clip."""
    from ico3d.avatar.animation import motion_quality

    played = motion_quality.playable(animation)
    if animation.quality:
        left_out = motion_quality.refused(animation.actions, played)
        report(motion_quality.in_words(animation, len(left_out)))
    else:
        report("how the motion looks was not measured: that takes the body's recording.")
    return played


def _baked(
    body: "TrainedBody",
    capture: "Capture | None",
    head: "HeadAt | None",
    cuts: "tuple[Cut, ...] | None",
    report: Report,
) -> "tuple[BodyParts, Callable[[], None]]":
    """The parts of the baked body, and a check that raises where baking costs too much.

    Raises:
        BundleError: If the body has one frame.
    """
    from functools import partial

    from ico3d.avatar.baking import body_bundle
    from ico3d.avatar.baking.skinned import skinned_bundle
    from ico3d.avatar.moving import check_moves

    check_moves(body)
    if skinned_bundle.is_skinned(body):
        result = skinned_bundle.bake(body, capture, head, cuts)
        report(f"the body: {result}.")
        return result.parts, partial(skinned_bundle.check, result)
    windows = body_bundle.bake(body, capture, head)
    results = _watched(windows, len(body.windows), report)
    return body_bundle.parts_of(results, body), partial(body_bundle.check, results)


def _watched(windows: "Iterator[WindowResult]", count: int, report: Report) -> "list[WindowResult]":
    """Collects baked windows and shows the progress."""
    from rich.progress import track

    from ico3d.avatar.baking.body_bundle import megabits_per_second

    results = []
    for result in track(windows, "baking", count):
        report(f"window {len(results)}: {result}")
        results.append(result)
    report(f"{megabits_per_second(results):.2f} Mbit/s while it plays.")
    return results


def _save_picture(picture, path: Path) -> None:
    from PIL import Image

    drawn = Image.fromarray(picture)
    write_atomic(path, lambda temporary: drawn.save(temporary))
