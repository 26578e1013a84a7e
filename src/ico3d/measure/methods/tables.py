"""Tables and lines that `ico3d bench body` prints."""

from collections.abc import Iterator, Sequence
from typing import get_args

from rich.table import Table

from ico3d.body.settings import Method
from ico3d.measure.methods.bench import OURS, Trial
from ico3d.measure.methods.unseen import SCORES


def line(trial: Trial, result: dict) -> str:
    """One line about a trial that has just ended."""
    return (
        f"{trial.method}, seed {trial.seed}: {_number(result['psnr_mask'])} dB, "
        f"{result['train_seconds']:.0f} s"
    )


def tables(figures: dict) -> Iterator[Table]:
    """Tables of a comparison of methods.

    Args:
        figures: Result of `ico3d.measure.methods.bench.summary`, with key `windows`: first and last
            frame of each window.
    """
    spans = [f"{first}–{last}" for first, last in figures["windows"]]
    methods = [method for method in get_args(Method) if method in figures]
    yield _qualities(figures, methods, spans)
    if len(methods) > 1 and OURS in methods:
        yield _margins(figures["margins"], spans)
    if any("unseen_psnr_mask" in figures[method]["mean"] for method in methods):
        yield _unseen(figures, methods)
    if "finetune" in figures:
        yield _finetuning(figures["finetune"])


def _qualities(figures: dict, methods: Sequence[str], spans: Sequence[str]) -> Table:
    table = Table(
        "method",
        "person",
        "seeds apart",
        "moving",
        *(f"frames {span}" for span in spans),
        "Gaussians",
        "training s",
        title="PSNR in dB on the person and on what moves; on the person in each window",
        title_justify="left",
    )
    for method in methods:
        mean, seeds = figures[method]["mean"], figures[method]["seeds"]
        values = [result["psnr_mask"] for result in seeds]
        table.add_row(
            method,
            _number(mean["psnr_mask"]),
            _number(max(values) - min(values)) if len(values) > 1 else "–",
            _number(mean["psnr_moving"]),
            *map(_number, mean["psnr_mask_per_window"]),
            f"{mean['num_gaussians']:,.0f}",
            f"{mean['train_seconds']:.0f}",
        )
    return table


def _margins(margins: dict, spans: Sequence[str]) -> Table:
    table = Table(
        f"{OURS} above",
        "person",
        "moving",
        *(f"frames {span}" for span in spans),
    )
    for other, values in margins.items():
        windows = map(_number, values["psnr_mask_per_window"])
        table.add_row(other, _number(values["psnr_mask"]), _number(values["psnr_moving"]), *windows)
    return table


def _unseen(figures: dict, methods: Sequence[str]) -> Table:
    table = Table("frames not trained", "person", "moving", "poses by pictures", "moving")
    for method in methods:
        mean = figures[method]["mean"]
        names = [f"{kind}_{name}" for kind in ("unseen", "unseen_fitted") for name in SCORES]
        table.add_row(method, *(_number(mean.get(name)) for name in names))
    return table


def _finetuning(figures: dict) -> Table:
    table = Table("fine-tuning", "person", "moving", "flicker")
    for when, values in figures.items():
        flicker = values["flicker"]
        table.add_row(
            when,
            _number(values["psnr_mask"]),
            _number(values["psnr_moving"]),
            "–" if flicker is None else f"{flicker:.4f}",
        )
    return table


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"
