"""A random head, or that of a bundle, with the persona of `persona.json`, for conversations.

Run: python talking_bundle.py OUT.ico3d [BUNDLE]
"""

import dataclasses
import sys
from pathlib import Path

from ico3d.avatar.baking.persona import load_persona
from ico3d.bundle.format import Bundle, write_bundle
from support.bundles.random_bundle import random_files, random_head, random_manifest

GAUSSIANS = 300
PERSONA = Path(__file__).with_name("persona.json")


def main() -> None:
    """Does what the file's docstring says."""
    out, *source = sys.argv[1:]
    if source:
        bundle = Bundle.open(source[0])
        manifest, files = bundle.manifest, {n: bundle.read(n) for n in bundle.manifest.files}
    else:
        head = random_head(GAUSSIANS)
        manifest, files = random_manifest(head), random_files(head)
    write_bundle(out, dataclasses.replace(manifest, persona=load_persona(PERSONA)), files)


if __name__ == "__main__":
    main()
