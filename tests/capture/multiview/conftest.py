import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def folders():
    """The writer of multiview folders."""
    path = Path(__file__).with_name("folders.py")
    spec = importlib.util.spec_from_file_location("folders", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def folder(folders, tmp_path):
    """Five cameras, three frames, without faults."""
    return folders.write_folder(tmp_path / "recording")


@pytest.fixture(scope="session")
def models():
    """The writer of models of other tools."""
    path = Path(__file__).with_name("models.py")
    spec = importlib.util.spec_from_file_location("models", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
