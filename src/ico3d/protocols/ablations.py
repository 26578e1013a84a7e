"""The protocol of ablations: what each part of the method is worth, one left out at a time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from ico3d.body.planning.flow import copy_cache
from ico3d.body.settings import BodySettings, Method
from ico3d.capture.formats import open_capture
from ico3d.capture.parts.head_of_body import head_in
from ico3d.capture.parts.held_out import PartOfCapture, scored_pictures
from ico3d.common.device import DeviceName
from ico3d.common.presets import PresetName
from ico3d.errors import SettingsError
from ico3d.head.model import Variant
from ico3d.head.model_folder import Inputs
from ico3d.head.settings import PRESETS, HeadSettings
from ico3d.head.train_head import HeadJob, train_head
from ico3d.measure.head import evaluate_head
from ico3d.measure.methods.bench import OURS, Trial, terms_for
from ico3d.measure.methods.settings import preset
from ico3d.protocols.charts import draw_quality
from ico3d.protocols.facts import facts_of
from ico3d.protocols.report import Column, Picture, Report, Section, Table, Value
from ico3d.protocols.rows import means, spread_of
from ico3d.splat.device import computing_device

Model = Literal["head", "body"]


@dataclass(frozen=True)
class HeadChange:
    """A head without a part of the method.

    Attributes:
        change: What becomes of the settings.
        variant: The model.
        steps: Steps relative to those of the whole method, so that trainings take equally long: at
            12,000 Gaussians and 256² a step takes 58 ms of one core with the MLP, 37 ms without.
    """

    change: Callable[[HeadSettings], HeadSettings] = lambda settings: settings
    variant: Variant = "full"
    steps: float = 1.0


@dataclass(frozen=True)
class BodyChange:
    """A body without a part of the method.

    Attributes:
        change: What becomes of the settings of SWinGS++.
        method: The method.
    """

    change: Callable[[BodySettings], BodySettings] = lambda settings: settings
    method: Method = OURS


WHOLE = "whole method"
HEADS: Mapping[str, HeadChange] = {
    WHOLE: HeadChange(),
    "no MLP": HeadChange(variant="no-mlp", steps=1.6),
    "no blending": HeadChange(variant="no-blending"),
    "no expression": HeadChange(variant="static", steps=1.6),
    "no SSIM": HeadChange(lambda s: replace(s, loss=replace(s.loss, l1=1.0, ssim=0.0))),
    "no density control": HeadChange(
        lambda s: replace(
            s,
            initial=replace(s.initial, gaussians=s.density.max_gaussians),
            density=replace(s.density, until=0),
        )
    ),
    "no weight decay": HeadChange(
        lambda s: replace(s, rates=replace(s.rates, basis_weight_decay=0.0))
    ),
    "SGD, no squares": HeadChange(  # SGD's gains were measured without squared differences
        lambda s: replace(s, optimiser="sgd", loss=replace(s.loss, squares=0.0))
    ),
    "no squares": HeadChange(lambda s: replace(s, loss=replace(s.loss, squares=0.0))),
    "no turns": HeadChange(lambda s: replace(s, turns=False)),
}
BODIES: Mapping[str, BodyChange] = {
    WHOLE: BodyChange(),
    "one set of weights": BodyChange(lambda s: replace(s, mlp=replace(s.mlp, sets=1))),
    "no encoder": BodyChange(method="swings"),
    "one window": BodyChange(method="4dgs"),
    "no motion": BodyChange(method="static"),
    "no warm-up": BodyChange(lambda s: replace(s, warmup_steps=0)),
    "no unfolding": BodyChange(lambda s: replace(s, unfolding=0.0)),
    "no SSIM": BodyChange(lambda s: replace(s, loss=replace(s.loss, ssim=0.0))),
    "no squares": BodyChange(lambda s: replace(s, loss=replace(s.loss, squares=0.0))),
}
HEAD_COLUMNS = (
    Column("psnr", "PSNR", 2, "more"),
    Column("psnr_mask", "PSNR-M", 2, "more"),
    Column("psnr_mouth", "PSNR, mouth", 2, "more"),
    Column("ssim", "SSIM", 4, "more"),
    Column("lpips_alex", "LPIPS (Alex)", 4, "less"),
    Column("lip_correlation", "lips: r", 3, "more"),
    Column("lip_lag_ms", "lips: lag, ms", 1),
)
BODY_COLUMNS = (
    Column("psnr_mask", "PSNR-M", 2, "more"),
    Column("psnr_moving", "PSNR where it moves", 2, "more"),
    Column("psnr", "PSNR", 2, "more"),
    Column("ssim", "SSIM", 4, "more"),
    Column("lpips", "LPIPS", 4, "less"),
    Column("flicker", "flicker at borders", 4, "less"),
)
SHARED = (
    Column("seeds_apart", "PSNR-M: seeds apart", 2),
    Column("num_gaussians", "Gaussians", 0),
    Column("train_seconds", "training, s", 0),
)


@dataclass(frozen=True)
class AblationTerms:
    """What is trained and measured.

    Attributes:
        capture: Path of the recording.
        out: Folder of trainings and report.
        model: Whether parts of the head's or of the body's method are left out.
        only: Names of the ablations; all if empty.
        seeds: Seeds of the trainings.
        preset: Preset of the settings.
        inputs: What drives heads.
        device: Where to compute.
        settings: Settings of the whole method; those of the preset if None.
    """

    capture: Path
    out: Path
    model: Model
    only: tuple[str, ...] = ()
    seeds: tuple[int, ...] = (0,)
    preset: PresetName = "cpu"
    inputs: Inputs = "speech"
    device: DeviceName = "auto"
    settings: HeadSettings | BodySettings | None = None

    def chosen(self) -> list[str]:
        """Names of the ablations, the whole method first.

        Raises:
            SettingsError: If a name is unknown.
        """
        known = HEADS if self.model == "head" else BODIES
        for name in self.only:
            if name not in known:
                raise SettingsError(f"there is no ablation '{name}': {', '.join(known)}.")
        return [name for name in known if name == WHOLE or not self.only or name in self.only]


def measure_ablations(terms: AblationTerms) -> Report:
    """Trains and measures what is missing, and writes a report.

    Raises:
        SettingsError: If an ablation is unknown.
        CaptureError: If the capture lacks something.
    """
    names = terms.chosen()
    trained = _head_rows if terms.model == "head" else _body_rows
    found = trained(terms, names)
    rows: list[dict[str, Value]] = [
        {"name": name, **means(found[name]), "seeds_apart": spread_of(found[name], "psnr_mask")}
        for name in names
    ]
    columns = (*(HEAD_COLUMNS if terms.model == "head" else BODY_COLUMNS), *SHARED)
    text = (
        "One part of the method is left out at a time, all else being equal. Means over pictures, "
        "then over seeds, of test pictures that trained nothing."
    )
    panels = {
        label: {
            name: [(float(row[key]), float(row["psnr_mask"])) for row in found[name]]  # type: ignore[arg-type]
            for name in names
        }
        for key, label in (("train_seconds", "training, s"), ("num_gaussians", "Gaussians"))
    }
    draw_quality(terms.out / "quality.png", panels, "PSNR-M (dB)")
    shown = Picture("quality.png", "PSNR-M of every training, by its time and its Gaussians")
    sections = [
        Section(f"Parts of the {terms.model}'s method", text, Table(columns, rows, "")),
        _below(columns, rows),
        Section("Pictures", pictures=[shown]),
    ]
    asked = {name: value for name, value in asdict(terms).items() if name != "device"}
    facts = facts_of(computing_device(terms.device), **asked)
    report = Report(f"What is each part of the {terms.model} worth?", facts, sections, found)
    report.write(terms.out)
    return report


def _below(columns: Sequence[Column], rows: Sequence[Mapping[str, Value]]) -> Section:
    """How much the whole method is above each ablation."""
    whole = rows[0]
    judged = [c for c in columns if c not in SHARED and c.better != "neither"]
    kept = [replace(c, better="neither") for c in judged]
    apart: list[dict[str, Value]] = []
    for row in rows[1:]:
        line: dict[str, Value] = {"name": row["name"]}
        for column in kept:
            ours, other = whole.get(column.key), row.get(column.key)
            if isinstance(ours, float | int) and isinstance(other, float | int):
                line[column.key] = ours - other
        apart.append(line)
    return Section("The whole method less the ablation", table=Table(kept, apart, ""))


def _head_rows(terms: AblationTerms, names: Sequence[str]) -> dict[str, list[dict]]:
    """Results by ablation, one for each seed."""
    capture = open_capture(terms.capture)
    given = terms.settings
    settings = given if isinstance(given, HeadSettings) else PRESETS[terms.preset]
    cameras, frames = scored_pictures(capture, "test")
    part = head_in(PartOfCapture(capture, cameras, frames))
    found: dict[str, list[dict]] = {}
    for name in names:
        without = HEADS[name]
        changed = without.change(replace(settings, steps=round(settings.steps * without.steps)))
        for seed in terms.seeds:
            job = HeadJob(terms.inputs, without.variant, "builtin", seed, changed)
            folder = terms.out / name.replace(" ", "-") / f"seed{seed}"
            head = train_head(capture, folder, job, device=terms.device)
            head.to(computing_device(terms.device))
            found.setdefault(name, []).append(evaluate_head(head, part, frames, None))
    return found


def _body_rows(terms: AblationTerms, names: Sequence[str]) -> dict[str, list[dict]]:
    """Results by ablation, one for each seed."""
    given = terms.settings
    settings = given if isinstance(given, BodySettings) else preset(OURS, terms.preset)
    base = terms_for(
        terms.capture, None, terms.out, settings, False, terms.device, preset=terms.preset
    )
    found: dict[str, list[dict]] = {}
    for name in names:
        without, folder = BODIES[name], terms.out / name.replace(" ", "-")
        copy_cache(base.folder / "flow", folder / "flow")
        changed = replace(base, folder=folder, ours=without.change(settings))
        found[name] = [Trial(without.method, seed, changed).run() for seed in terms.seeds]
    return found
