import importlib.util
from pathlib import Path

import pytest


def _module(name):
    """A file beside this one."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def layout():
    """The writer of talking-portrait folders."""
    return _module("portrait_folder")


@pytest.fixture(scope="session")
def faces():
    """Landmarks of a face, and heads that move."""
    return _module("faces")


@pytest.fixture(scope="session")
def two_balls():
    """A person of two balls, and who sees what of them."""
    return _module("two_balls")


@pytest.fixture
def folder(tmp_path, layout):
    """A talking-portrait folder without faults."""
    return layout.write_folder(tmp_path / "person")
