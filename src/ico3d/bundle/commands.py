"""The verb `ico3d bundle info`."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import tyro

if TYPE_CHECKING:
    from ico3d.bundle.format import Bundle


@dataclass(frozen=True)
class Info:
    """Checks a bundle and prints what it holds.

    Attributes:
        bundle: The avatar: NAME.ico3d or its folder; `demo` is the avatar of the package.
        json: Also write the printed figures to this file.
    """

    bundle: tyro.conf.Positional[Path]
    json: Path | None = None

    def run(self) -> None:
        """Prints the figures and writes the file.

        Raises:
            BundleError: If the bundle does not exist or fails a check.
        """
        import json

        from rich.console import Console

        from ico3d.bundle.format import Bundle
        from ico3d.bundle.packaged import bundle_path
        from ico3d.common.files import write_atomic
        from ico3d.errors import printable

        found = figures(Bundle.open(self.bundle), bundle_path(self.bundle))
        if self.json is not None:
            write_atomic(self.json, json.dumps(found, indent=1, ensure_ascii=False).encode())
        console = Console(highlight=False, soft_wrap=True)
        for name, value in found.items():
            if value is not None:
                console.print(printable(f"{name:18} {_line(value)}"), markup=False)


def figures(bundle: "Bundle", path: Path) -> dict[str, Any]:
    """Facts about a bundle, JSON-serialisable.

    Args:
        bundle: The opened bundle.
        path: Path of the bundle.

    Returns:
        Among others: `bytes` on disk; `head_gaussians`, null without a head; `body_windows`, the
        number of windows, 0 without a body or with one on a skeleton; `body_gaussians` of each
        window, or of the body on a skeleton; `voice`, null unless one was cloned; `provenance`.
    """
    from ico3d.bundle.people.provenance import provenance_to_json
    from ico3d.common.typed import plain

    manifest = bundle.manifest
    head, speech, moving = manifest.head, manifest.speech, manifest.any_body
    windows = manifest.body.windows if manifest.body else ()
    voice = manifest.provenance.voice
    sizes = {name: entry.size for name, entry in manifest.files.items()}
    return {
        "name": manifest.name,
        "bytes": path.stat().st_size if os.path.isfile(path) else sum(map(len, _contents(bundle))),
        "version": manifest.version,
        "head_gaussians": head.num_gaussians if head else None,
        "head_rank": head.rank if head else None,
        "inputs": head.inputs if head else None,
        "speech_encoder": speech.encoder if speech else None,
        "body_windows": len(windows),
        "body_gaussians": [part.num_gaussians for part in (*windows, manifest.skinned) if part],
        "body_joints": manifest.skinned.num_joints if manifest.skinned else None,
        "body_seconds": (moving.num_frames - 1) / moving.fps if moving else None,
        "animation": bundle.animation is not None,
        "background": bundle.background,
        "voice": voice and f"cloned from {voice.recording}; consent: {voice.consent}",
        "loss": plain(manifest.loss),
        "provenance": provenance_to_json(manifest.provenance),
        "files": sizes,
    }


def _contents(bundle: "Bundle"):
    return (bundle.read(name) for name in bundle.names)


def _line(value: Any) -> str:
    """One value for people."""
    if isinstance(value, dict):
        parts = cast(dict[str, Any], value)
        return ", ".join(f"{key}: {_line(part)}" for key, part in parts.items())
    if isinstance(value, list):
        return "; ".join(map(_line, cast(list[Any], value))) or "–"
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)
