"""Pictures of a screen as an animated WebP in their own time, of at most a megabyte.

Run: python film.py FOLDER OUT.webp

FOLDER holds JPEGs named by the milliseconds at which they were seen.
"""

import sys
from pathlib import Path

from PIL import Image

WIDTH = 420
RATE = 15
"""Pictures per second, at most."""
MOST_BYTES = 950_000
QUALITIES = (80, 70, 60, 50, 40, 30)


def main() -> None:
    """Does what the file's docstring says."""
    folder, out = map(Path, sys.argv[1:])
    seen = sorted((int(path.stem), path) for path in folder.glob("*.jpg"))
    kept: list[tuple[int, Path]] = []
    for at, path in seen:
        if not kept or at - kept[-1][0] >= 1000 / RATE - 1:
            kept.append((at, path))
    ends = [at for at, _ in kept[1:]] + [seen[-1][0] + 1000]
    pictures = [_smaller(path) for _, path in kept]
    durations = [end - at for end, (at, _) in zip(ends, kept, strict=True)]
    for quality in QUALITIES:
        first, *others = pictures
        first.save(
            out, save_all=True, append_images=others, duration=durations, quality=quality, loop=0
        )
        size = out.stat().st_size
        print(f"{len(pictures)} pictures of {sum(durations) / 1000:.1f} s, {size:,} bytes")
        if size <= MOST_BYTES:
            return
    sys.exit(f"{out} has more than {MOST_BYTES:,} bytes.")


def _smaller(path: Path) -> Image.Image:
    """A picture in the width of the film."""
    with Image.open(path) as picture:
        size = (WIDTH, round(picture.height * WIDTH / picture.width))
        return picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)


if __name__ == "__main__":
    main()
