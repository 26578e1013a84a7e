"""Wheels that pip finds in a folder, and nowhere else."""

import zipfile


def only_from(folder, monkeypatch):
    """Has pip look for packages in one folder alone."""
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))


def write_wheel(folder, files):
    """Writes the package `tinypipe` 1.2.3 with some files."""
    about = "Metadata-Version: 2.1\nName: tinypipe\nVersion: 1.2.3\n"
    kind = "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: false\nTag: py3-none-any\n"
    with zipfile.ZipFile(folder / "tinypipe-1.2.3-py3-none-any.whl", "w") as wheel:
        for name, data in files.items():
            wheel.writestr(name, data)
        wheel.writestr("tinypipe-1.2.3.dist-info/METADATA", about)
        wheel.writestr("tinypipe-1.2.3.dist-info/WHEEL", kind)
        wheel.writestr("tinypipe-1.2.3.dist-info/RECORD", "")
