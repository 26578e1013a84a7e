import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def smc(faces):
    """The writer of RenderMe-360 recordings."""
    path = Path(__file__).with_name("smc_files.py")
    spec = importlib.util.spec_from_file_location("renderme_files", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.faces = faces
    return module
