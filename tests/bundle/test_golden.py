"""Bundles that the program of each version wrote, in `golden/`: today's shows the same Gaussians.

What `expected.json` says of them, the program that wrote them computed: colours, opacities and
centres for one expression, sums of poses and of each tensor.
"""

import dataclasses
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from ico3d.bundle.evaluate import attributes, centres
from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import VERSION
from ico3d.errors import BundleError

GOLDEN = Path(__file__).parent / "golden"
EXPECTED = json.loads((GOLDEN / "expected.json").read_text())
FILES = sorted(path.name for path in GOLDEN.glob("*.ico3d"))


def sums(tensors):
    """The sum of each tensor by name."""
    values = {field.name: getattr(tensors, field.name) for field in dataclasses.fields(tensors)}
    return {
        name: float(np.sum(value, dtype=np.float64))
        for name, value in values.items()
        if isinstance(value, np.ndarray)
    }


def stated_version(path):
    with zipfile.ZipFile(path) as archive:
        return json.loads(archive.read("manifest.json"))["version"]


def test_there_is_one_of_each_version():
    assert {stated_version(GOLDEN / name) for name in FILES} == set(range(1, VERSION + 1))
    assert set(FILES) == set(EXPECTED)


@pytest.mark.parametrize("name", FILES)
def test_an_old_bundle_shows_what_it_showed(name):
    said, bundle = EXPECTED[name], Bundle.open(GOLDEN / name)
    assert stated_version(GOLDEN / name) == said["version"]
    assert bundle.manifest.name == said["name"] and bundle.manifest.version == VERSION
    if "rgb" in said:
        head, poses = bundle.require_head()
        expression = np.linspace(-1, 1, len(head.w1))
        colors, opacities = attributes(head, expression)
        np.testing.assert_allclose(colors, said["rgb"], atol=2e-4)
        np.testing.assert_allclose(opacities, said["opacity"], atol=2e-4)
        where = said.get("centres", head.means)  # Gaussians stood still before version 6
        np.testing.assert_allclose(centres(head, expression, said.get("gaze")), where, atol=2e-4)
        np.testing.assert_allclose(poses.sum(0), said["poses"], atol=1e-3)
    for index, tensors in enumerate(said.get("windows", ())):
        assert sums(bundle.window(index)) == pytest.approx(tensors, abs=1e-3)
    for tensor, value in said.get("skinned", {}).items():
        assert sums(bundle.skinned)[tensor] == pytest.approx(value, abs=1e-3)


@pytest.mark.parametrize("version", [0, VERSION + 1, "5", None])
def test_a_version_that_is_not_known_is_told(tmp_path, version):
    folder = tmp_path / "a.ico3d"
    with zipfile.ZipFile(GOLDEN / FILES[0]) as archive:
        archive.extractall(folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(manifest | {"version": version}))
    with pytest.raises(BundleError, match=f"reads bundles of versions 1 to {VERSION} only"):
        Bundle.open(folder)
