import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def smc():
    """The writer of DNA-Rendering recordings."""
    path = Path(__file__).with_name("smc_files.py")
    spec = importlib.util.spec_from_file_location("smc_files", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
