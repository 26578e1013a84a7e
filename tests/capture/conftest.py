import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def layout():
    """The writer of talking-portrait folders."""
    path = Path(__file__).with_name("portrait_folder.py")
    spec = importlib.util.spec_from_file_location("portrait_folder", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def folder(tmp_path, layout):
    """A talking-portrait folder without faults."""
    return layout.write_folder(tmp_path / "person")
