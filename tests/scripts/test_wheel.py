"""The wheel that users install holds all that talking with the packaged avatar takes."""

import email
import json
import os
import re
import site
import subprocess
import sys
import urllib.request
import zipfile
from pathlib import Path

import pytest

import ico3d

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
BUILD = "import sys; from hatchling.build import build_wheel; print(build_wheel(sys.argv[1]))"
STAND_INS = 'recognition = "pocketsphinx"\nlanguage = "persona-notes"\nvoice = "espeak-ng"\n'
WHERE = "import ico3d, json, sys; print(json.dumps([ico3d.__file__, *sys.path]))"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel of this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    done = subprocess.run(
        [sys.executable, "-c", BUILD, str(folder)], cwd=ROOT, capture_output=True, check=True
    )
    return folder / done.stdout.decode().split()[-1]


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """An environment with the wheel and its dependencies, and no way to the checkout.

    Gives the folder that holds the package, and the variables of the environment. The
    dependencies are borrowed from the environment of the tests; without Python's `site`, its
    link to the checkout is not followed.
    """
    folder = tmp_path_factory.mktemp("installed")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", "install"]
    options = ["--no-deps", "--no-index", "--no-compile", "--target", str(folder)]
    subprocess.run([*pip, *options, str(wheel)], check=True)
    path = os.pathsep.join([str(folder), *site.getsitepackages()])
    return folder, {**os.environ, "PYTHONPATH": path}


def run(installed, *words):
    """What the installed program says."""
    folder, variables = installed
    command = [sys.executable, "-S", str(folder / "bin" / "ico3d"), *words]
    return subprocess.run(command, env=variables, capture_output=True, text=True, check=True).stdout


def test_one_version_everywhere(wheel, installed):
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith("/METADATA"))
        described = email.message_from_bytes(archive.read(name))
    assert described["Version"] == ico3d.__version__
    assert wheel.name.split("-")[1] == ico3d.__version__
    assert run(installed, "--version") == f"ico3d {ico3d.__version__}\n"


def test_the_checkout_is_out_of_reach(installed):
    folder, variables = installed
    command = [sys.executable, "-S", "-c", WHERE]
    done = subprocess.run(command, env=variables, cwd=folder, capture_output=True, check=True)
    package, *path = json.loads(done.stdout)
    assert Path(package) == folder / "ico3d" / "__init__.py"
    assert str(ROOT / "src") not in path


def test_the_packaged_avatar_is_served(installed, tmp_path):
    folder, variables = installed
    (tmp_path / "settings.toml").write_text(STAND_INS)
    words = ["demo", "--port", "0", "--settings", "settings.toml", "--no-browser"]
    command = [sys.executable, "-S", str(folder / "bin" / "ico3d"), *words]
    with subprocess.Popen(
        command, env=variables, cwd=tmp_path, stdout=subprocess.PIPE, text=True
    ) as server:
        try:
            assert server.stdout is not None
            url = re.search(r"http://[\d.]+:\d+", server.stdout.readline())
            assert url is not None, "no address was printed"
            assert json.loads(fetched(f"{url[0]}/health"))["ok"] is True
            page = fetched(f"{url[0]}/").decode()
            script = re.search(r'src="\.?/?(assets/[^"]+\.js)"', page)
            assert script is not None, "the page has no script"
            drawing = re.findall(r'rel="modulepreload"[^>]* href="\.?/?(assets/[^"]+\.js)"', page)
            scripts = [fetched(f"{url[0]}/{name}") for name in (script[1], *drawing)]
            assert sum(map(len, scripts)) > 300_000, "what draws is missing"
            manifest = json.loads(fetched(f"{url[0]}/bundle/manifest.json"))
            assert manifest["format"] == "ico3d-bundle"
        finally:
            server.terminate()


def fetched(url):
    """The body of an answer; the server listens before it prints its address."""
    with urllib.request.urlopen(url, timeout=60) as answer:
        return answer.read()
