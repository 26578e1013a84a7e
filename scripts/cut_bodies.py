"""Cuts the studio page's pictures of bodies out of the documentation's picture of stand-ins.

Run: python scripts/cut_bodies.py

`viewer/src/studio/bodies.webp` has a build in each row and an outfit in each column, without the
heads, since a person's own comes there.
"""

from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
SHEET = ROOT / "docs" / "images" / "stand-ins.jpg"
OUT = ROOT / "viewer" / "src" / "studio" / "bodies.webp"
FIRST, APART, ROWS = (76, 62), 500.2, 1004 / 3
"""Middle of the first body's neck in pixels, and how far apart outfits and builds are."""
SIZE = (132, 272)
"""Width and height of a body in pixels."""


def main() -> None:
    """Writes the sheet."""
    width, height = SIZE
    sheet = Image.new("RGB", (3 * width, 3 * height))
    with Image.open(SHEET) as whole:
        for build in range(3):
            for outfit in range(3):
                left = round(FIRST[0] + APART * outfit) - width // 2
                top = round(FIRST[1] + ROWS * build)
                body = whole.crop((left, top, left + width, top + height))
                sheet.paste(body, (outfit * width, build * height))
    sheet.save(OUT, quality=72, method=6)


if __name__ == "__main__":
    main()
