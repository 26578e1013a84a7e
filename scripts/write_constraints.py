"""Writes constraints.txt: the versions of this environment that ico3d's extras bring.

Run it in an environment of `make install` in which `make test` has passed. Left out are local
variants such as a CPU build's, so that machines with a GPU take their own of the same version.
"""

import importlib.metadata
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[1]
HEAD = """\
# Versions that the tests ran with, on Python {version[0]}.{version[1]}.
# Written by scripts/write_constraints.py; pyproject.toml says which others may do.
"""


def wanted() -> Iterator[Requirement]:
    """What the project and all of its extras ask for."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    lists = [project["dependencies"], *project["optional-dependencies"].values()]
    yield from (Requirement(text) for texts in lists for text in texts)


def installed() -> dict[str, str]:
    """Version by name of all that is here and wanted, directly or by something that is."""
    versions: dict[str, str] = {}
    seen: set[tuple[str, frozenset[str]]] = set()
    ahead = list(wanted())
    while ahead:
        asked = ahead.pop()
        name, extras = canonicalize_name(asked.name), frozenset(asked.extras)
        if (name, extras) in seen:
            continue
        seen.add((name, extras))
        try:
            found = importlib.metadata.distribution(name)
        except importlib.metadata.PackageNotFoundError:
            continue  # of an extra that is not installed here
        versions[name] = Version(found.version).public
        ahead += [
            need for text in found.requires or () if applies(need := Requirement(text), extras)
        ]
    return versions


def applies(requirement: Requirement, extras: frozenset[str]) -> bool:
    """Whether it is needed on this machine with these extras."""
    marker = requirement.marker
    return marker is None or any(marker.evaluate({"extra": extra}) for extra in {*extras, ""})


if __name__ == "__main__":
    lines = [f"{name}=={version}\n" for name, version in sorted(installed().items())]
    head = HEAD.format(version=sys.version_info)
    (ROOT / "constraints.txt").write_text(head + "".join(lines), "utf-8")
