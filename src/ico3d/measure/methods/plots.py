"""Pictures of how good a body is: over its frames, and by its cameras."""

from pathlib import Path

from ico3d.common.files import write_atomic

INK, PALE, BORDER = "#2255aa", "#dd8833", "#999999"


def plot_body(result: dict, folder: Path) -> None:
    """Draws what `evaluate_body` gave.

    Args:
        result: Its metrics.
        folder: Where `frames.png` (PSNR over time, window borders dashed) and `cameras.png` go.
    """
    _save(_frames(result), folder / "frames.png")
    _save(_cameras(result), folder / "cameras.png")


def _frames(result: dict):
    """PSNR on the person and on what moves, over the frames."""
    figure, axes = _figure(9)
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
    """PSNR on the person as a bar per camera."""
    entries = result["per_camera"]
    figure, axes = _figure(max(4.0, 0.5 * len(entries) + 2))
    values = [_or_gap(entry["psnr_mask"]) for entry in entries]
    axes.bar([entry["camera"] for entry in entries], values, color=INK)
    seen = [value for value in values if value == value]
    if seen:  # from 0 on, all would look alike
        axes.set_ylim(min(seen) - 3, max(seen) + 1)
    axes.set_xlabel("camera")
    axes.tick_params(axis="x", rotation=60)
    return figure


def _figure(width: float):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, 4), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    axes.set_ylabel("PSNR (dB)")
    axes.grid(axis="y", alpha=0.3)
    return figure, axes


def _or_gap(value: float | None) -> float:
    return float("nan") if value is None else value


def _save(figure, path: Path) -> None:
    write_atomic(path, lambda temporary: figure.savefig(temporary))
