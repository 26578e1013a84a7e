from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def bundle_bytes(tmp_path_factory) -> bytes:
    """A valid bundle, small enough for thousands of mutations."""
    from support.bundles.random_bundle import write_random_bundle

    path = tmp_path_factory.mktemp("bundle") / "valid.ico3d"
    write_random_bundle(path, 60)
    return path.read_bytes()


@pytest.fixture
def bundle_path(bundle_bytes, tmp_path) -> Path:
    path = tmp_path / "valid.ico3d"
    path.write_bytes(bundle_bytes)
    return path


@pytest.fixture
def bundle_folder(bundle_path, tmp_path) -> Path:
    import zipfile

    folder = tmp_path / "folder"
    with zipfile.ZipFile(bundle_path) as archive:
        archive.extractall(folder)
    return folder
