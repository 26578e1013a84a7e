"""The protocol of bodies: novel views by test cameras, by method (paper, section 4.1)."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import get_args

import numpy as np
from rich.console import Console

from ico3d.body.model_folder import TrainedBody
from ico3d.body.settings import Method
from ico3d.capture.capture import Capture
from ico3d.measure.body import BodyRenderer, BodyTruth
from ico3d.measure.methods.bench import OURS, Terms, Trial, open_clip, run_trials, summary
from ico3d.protocols.charts import draw_lines, draw_quality, draw_strip
from ico3d.protocols.facts import facts_of
from ico3d.protocols.report import Column, Picture, Report, Section, Table, Value
from ico3d.protocols.rows import spread_of
from ico3d.splat.device import computing_device

QUALITY = (
    Column("psnr_mask", "PSNR-M", 2, "more"),
    Column("psnr", "PSNR", 2, "more"),
    Column("ssim", "SSIM", 4, "more"),
    Column("lpips", "LPIPS", 4, "less"),
    Column("psnr_moving", "PSNR where it moves", 2, "more"),
    Column("seeds_apart", "PSNR-M: seeds apart", 2),
    Column("num_gaussians", "Gaussians", 0),
    Column("train_seconds", "training, s", 0, "less"),
)
PAPER = (
    ("SWinGS++", 23.695, 30.1701, 0.9699, 0.0807),
    ("SWinGS", 22.9739, 29.4488, 0.9647, 0.0902),
    ("Spacetime Gaussians", 22.8494, 29.3039, 0.9621, 0.0924),
    ("4DGS", 20.2145, 26.8197, 0.9441, 0.1152),
    ("HuGS", 18.954, 25.04, 0.9404, 0.1118),
)
"""The paper's figures on six sequences of DNA-Rendering: PSNR-M, PSNR, SSIM, LPIPS."""


def measure_body(
    terms: Terms, methods: Sequence[Method], seeds: Sequence[int], jobs: int, out: Path
) -> Report:
    """Trains and measures what is missing, and writes the report.

    Args:
        terms: What all trainings have in common.
        methods: Methods to train.
        seeds: Seeds of the trainings of each method.
        jobs: Number of trainings at a time.
        out: Folder of the report.
    """
    trials = [Trial(method, seed, terms) for seed in seeds for method in methods]
    console = Console()
    results = run_trials(trials, jobs, lambda trial, found: console.print(trial.line(found)))
    report = body_report(results, trials, out)
    report.write(out)
    return report


def body_report(results: Mapping[Method, list[dict]], trials: Sequence[Trial], out: Path) -> Report:
    """The report of trained and measured methods.

    Args:
        results: Results by method, from `ico3d.measure.methods.bench.run_trials`.
        trials: The trials they come from, all of the same terms.
        out: Folder of the report; receives the pictures.
    """
    terms = trials[0].terms
    capture = open_clip(terms.capture, terms.frames)
    figures = summary(dict(results))
    figures["windows"] = [[window.first, window.last] for window in terms.windows]
    methods = [method for method in get_args(Method) if method in figures]
    sections = [
        Section(
            "Novel views", _how(capture, terms), Table(QUALITY, _rows(figures, methods), "method")
        ),
        _windows(figures, methods),
        *_unseen(figures, methods),
        *_finetuning(figures),
        Section("Pictures", pictures=_pictures(figures, methods, trials, capture, out)),
        _paper(),
    ]
    device = computing_device(terms.device)
    facts = facts_of(
        device,
        capture=str(terms.capture),
        test_cameras=", ".join(capture.cameras[i].name for i in capture.split.test_cameras),
        preset=terms.preset,
        seeds=", ".join(str(seed) for seed in sorted({trial.seed for trial in trials})),
        settings={method: repr(terms.settings(method)) for method in methods},
    )
    return Report("Which method draws a moving body best?", facts, sections, figures)


def _how(capture: Capture, terms: Terms) -> str:
    train = len(capture.cameras) - len(capture.split.test_cameras)
    first = capture.cameras[0]
    alike = "drawn in a picture" if terms.equal_drawn else "summed over windows"
    return (
        f"{train} cameras train, {len(capture.split.test_cameras)} test, in all "
        f"{capture.num_frames} frames; the first camera's pictures have {first.width} × "
        f"{first.height} pixels. Pictures are compared whole, uncropped, before the clean plate "
        "or, without one, with the person cut out on black: PSNR and SSIM depend on how much of a "
        "picture is empty, PSNR-M, on the recorded mask alone, does not. Means over pictures, then "
        f"over seeds. All methods have equal steps and, {alike}, equal Gaussians (on a "
        "skeleton those of one window), the same losses and the same density control; settings "
        "that were given apply to all. The presets of the others were tuned less than ours "
        f"(docs/choices.md). The clip is cut into {len(terms.windows)} windows."
    )


def _rows(figures: Mapping, methods: Sequence[Method]) -> list[dict[str, Value]]:
    rows = []
    for method in methods:
        apart = spread_of(figures[method]["seeds"], "psnr_mask")
        rows.append({"name": method, "seeds_apart": apart, **figures[method]["mean"]})
    return rows


def _windows(figures: Mapping, methods: Sequence[Method]) -> Section:
    """PSNR-M in each window."""
    spans = [f"{first}–{last}" for first, last in figures["windows"]]
    columns = [Column(span, f"frames {span}", 2, "more") for span in spans]
    rows = [
        {
            "name": method,
            **dict(zip(spans, figures[method]["mean"]["psnr_mask_per_window"], strict=True)),
        }
        for method in methods
    ]
    return Section("PSNR-M in each window", table=Table(columns, rows, "method"))


def _unseen(figures: Mapping, methods: Sequence[Method]) -> list[Section]:
    """Frames after those that trained, if they were measured."""
    columns = (
        Column("unseen_psnr_mask", "PSNR-M", 2, "more"),
        Column("unseen_psnr_moving", "where it moves", 2, "more"),
        Column("unseen_fitted_psnr_mask", "PSNR-M, poses by pictures", 2, "more"),
        Column("unseen_fitted_psnr_moving", "where it moves", 2, "more"),
    )
    rows = [{"name": method, **figures[method]["mean"]} for method in methods]
    if all(row.get(columns[0].key) is None for row in rows):
        return []
    text = (
        "Frames after those that trained. On a skeleton the body takes the poses of the body "
        "track, as tracked and fitted to the training cameras' pictures of those frames; other "
        "methods stay as they were in their last frame."
    )
    return [Section("Poses that trained nothing", text, Table(columns, rows, "method"))]


def _finetuning(figures: Mapping) -> list[Section]:
    """SWinGS++ before and after temporal fine-tuning, if it was fine-tuned."""
    if "finetune" not in figures:
        return []
    columns = (
        Column("flicker", "flicker at borders", 4, "less"),
        Column("psnr_mask", "PSNR-M", 2, "more"),
        Column("psnr_moving", "where it moves", 2, "more"),
    )
    rows = [{"name": when, **values} for when, values in figures["finetune"].items()]
    return [Section("Temporal fine-tuning", table=Table(columns, rows, OURS))]


def _pictures(
    figures: Mapping,
    methods: Sequence[Method],
    trials: Sequence[Trial],
    capture: Capture,
    out: Path,
) -> list[Picture]:
    """Plots of quality, and a strip of one test picture."""
    panels: dict[str, dict[str, list]] = {
        label: {
            method: [(result[key], result["psnr_mask"]) for result in figures[method]["seeds"]]
            for method in methods
        }
        for key, label in (("train_seconds", "training, s"), ("num_gaussians", "Gaussians"))
    }
    draw_quality(out / "quality.png", panels, "PSNR-M (dB)")
    spans = [f"{first}–{last}" for first, last in figures["windows"]]
    lines: dict[str, list] = {
        method: figures[method]["mean"]["psnr_mask_per_window"] for method in methods
    }
    shown = [Picture("quality.png", "PSNR-M of every training, by its time and its Gaussians")]
    if len(spans) > 1:
        draw_lines(out / "windows.png", lines, "window", "PSNR-M (dB)")
        shown.append(Picture("windows.png", "PSNR-M in each window"))
    drawn = _drawn(methods, trials, capture)
    if drawn is not None:
        truth, pictures, caption = drawn
        draw_strip(out / "strip.png", truth, pictures)
        shown.append(Picture("strip.png", caption))
    return shown


def _drawn(
    methods: Sequence[Method], trials: Sequence[Trial], capture: Capture
) -> tuple[np.ndarray, dict[str, np.ndarray], str] | None:
    """The recorded picture in which most moves, and each method's picture of it."""
    truths, camera = BodyTruth(capture), capture.split.test_cameras[0]
    moving = {
        frame: int(truth.moving.sum())
        for frame in range(capture.num_frames)
        if (truth := truths.at(camera, frame)) is not None
    }
    if not moving:
        return None
    frame = max(moving, key=lambda f: moving[f])
    truth = truths.at(camera, frame)
    assert truth is not None
    rows, columns = _person(truth.mask, truth.picture.shape)
    pictures = {}
    for method in methods:
        trial = next(t for t in trials if t.method == method)
        device = computing_device(trial.terms.device)
        body = TrainedBody.load(trial.folder).to(device)
        picture = BodyRenderer(body, capture, device).picture(camera, frame)
        pictures[method] = picture[rows, columns]
    caption = f"Camera {capture.cameras[camera].name}, frame {frame}, in which most moves"
    return truth.picture[rows, columns], pictures, caption


def _person(mask: np.ndarray | None, shape: Sequence[int]) -> tuple[slice, slice]:
    """Rows and columns of the box around the person, with a little air; all without a mask."""
    if mask is None or not (mask > 0.5).any():
        return slice(0, shape[0]), slice(0, shape[1])
    air = max(4, shape[0] // 40)
    spans = []
    for axis in (1, 0):
        found = np.flatnonzero((mask > 0.5).any(axis))
        spans.append(slice(max(0, found[0] - air), found[-1] + 1 + air))
    return spans[0], spans[1]


def _paper() -> Section:
    """The paper's own table."""
    keys = ("psnr_mask", "psnr", "ssim", "lpips")
    rows = [{"name": name, **dict(zip(keys, values, strict=True))} for name, *values in PAPER]
    text = (
        "Six sequences of DNA-Rendering, 225 frames each, 48 cameras train and 12 test; pictures "
        "cropped by masks. Comparable with the table above only on the same sequences."
    )
    return Section("The paper's figures", text, Table(QUALITY[:4], rows, "method"))
