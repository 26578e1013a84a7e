"""Charts of a body's PSNR: over frames, and by camera."""

from pathlib import Path

from ico3d.common.files import write_atomic

PSNR = "PSNR (dB)"
INK, PALE, BORDER = "#2255aa", "#dd8833", "#999999"


def plot_body(result: dict, folder: Path) -> None:
    """Draws charts of the metrics of a body.

    Args:
        result: Metrics from `evaluate_body`.
        folder: Folder for `frames.png` (PSNR over frames, window borders dashed) and `cameras.png`
            (PSNR of each camera).
    """
    save_figure(_frames(result), folder / "frames.png")
    save_figure(_cameras(result), folder / "cameras.png")


def _frames(result: dict):
    """Chart of the PSNR on the person and on moving pixels over frames."""
    figure, axes = new_figure(9, PSNR)
    numbers = [entry["frame"] for entry in result["per_frame"]]
    for key, label, color in (
        ("psnr_mask", "person", INK),
        ("psnr_moving", "moving pixels", PALE),
    ):
        values = [_or_gap(entry[key]) for entry in result["per_frame"]]
        axes.plot(numbers, values, ".-", color=color, label=label)
    for border in result["per_border"]:
        axes.axvline(border["frame"], color=BORDER, linestyle="--", linewidth=1)
    axes.set_xlabel("frame (dashed: window borders)")
    axes.legend()
    return figure


def _cameras(result: dict):
    """Chart of the PSNR on the person, with a bar for each camera."""
    entries = result["per_camera"]
    figure, axes = new_figure(max(4.0, 0.5 * len(entries) + 2), PSNR)
    values = [_or_gap(entry["psnr_mask"]) for entry in entries]
    axes.bar([entry["camera"] for entry in entries], values, color=INK)
    seen = [value for value in values if value == value]
    if seen:  # on an axis from 0 on, all bars would look alike
        axes.set_ylim(min(seen) - 3, max(seen) + 1)
    axes.set_xlabel("camera")
    axes.tick_params(axis="x", rotation=60)
    return figure


def new_figure(width: float, label: str):
    """A figure of a width in inches, and its axes, whose upward one has a label."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, 4), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    axes.set_ylabel(label)
    axes.grid(axis="y", alpha=0.3)
    return figure, axes


def _or_gap(value: float | None) -> float:
    return float("nan") if value is None else value


def save_figure(figure, path: Path) -> None:
    """Writes a figure as a PNG file."""
    write_atomic(path, lambda temporary: figure.savefig(temporary))
