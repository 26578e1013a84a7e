"""A random head with long things to say, for conversations in tests.

Run: python viewer/support/talking_bundle.py OUT.ico3d
"""

import dataclasses
import sys
from pathlib import Path

from ico3d.bundle.format import write_bundle
from ico3d.bundle.manifest import Persona

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "bundle"))
from random_bundle import random_files, random_head, random_manifest

GAUSSIANS = 300
LONG = (
    "The stars are very far away, and the nearest of them is more than four light years from here. "
    "A ship as fast as any that was ever built would need many thousands of years to get there. "
    "So a new home in the stars is a task for our children, and for the children of our children."
)


def main() -> None:
    """Does what the file's docstring says."""
    head = random_head(GAUSSIANS)
    notes = (
        f"we must find a new home in the stars | stars | new home => {LONG}",
        "who are you => I am Random.",
    )
    persona = Persona("Random", "Hello.", notes)
    manifest = dataclasses.replace(random_manifest(head), persona=persona)
    write_bundle(sys.argv[1], manifest, random_files(head))


if __name__ == "__main__":
    main()
