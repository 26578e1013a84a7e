"""Nothing of the folder in which a command is started is believed: it may be a stranger's."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ico3d.common.native.hidden import hidden
from support.needs import needs

CLEAN = {
    k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_", "LD_LIBRARY", "GNUTLS"))
}


def run_in(folder: Path, program: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Runs a program in a folder."""
    words, about = [sys.executable, "-P", "-c", program], {**CLEAN, **variables}
    done = subprocess.run(words, cwd=folder, env=about, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr[-2000:]
    return done


def said_in(folder: Path, program: str) -> str:
    """What a program prints that runs in a folder."""
    return run_in(folder, program).stdout.strip()


def test_numba_reads_no_settings_there(tmp_path):
    """It would unpickle what lies in the cache that they name, and write the trace they want."""
    diary = tmp_path / "diary.txt"
    diary.write_text("Dear diary")
    settings = f"cache_dir: cache\ndisable_jit: 1\nchrome_trace: {diary}\n"
    (tmp_path / ".numba_config.yaml").write_text(settings)
    found = said_in(
        tmp_path,
        "import yaml, ico3d.capture.surface.hull as hull, ico3d.splat.cpu.forward\n"
        "from ico3d.common.native.jit import config\n"
        "assert (config.CACHE_DIR, config.DISABLE_JIT, config.CHROME_TRACE) == ('', 0, '')\n"
        "assert yaml.safe_load('1') == 1\n"
        "print(hull._look.stats.cache_path)\n",
    )
    from ico3d.capture.surface import hull

    assert Path(found).parent == Path(hull.__file__).parent
    assert diary.read_text() == "Dear diary"


def test_all_kernels_come_by_the_guarded_way():
    source = Path(hidden.__wrapped__.__code__.co_filename).parents[2]
    direct = [
        file.name
        for file in source.rglob("*.py")
        if file.name != "jit.py"
        and any(line.strip().startswith(("import numba", "from numba")) for line in file.open())
    ]
    assert direct == []


def test_libraries_are_not_looked_for_there_by_what_is_started_later(tmp_path):
    """OpenCV leaves a list of folders that ends in nothing, which means the current folder."""
    pytest.importorskip("cv2")
    for before in ("", "/opt/x:", ":/opt/x::/opt/y"):
        program = (
            f"import os; os.environ['LD_LIBRARY_PATH'] = {before!r}\n"
            "import ico3d, cv2; print(os.environ['LD_LIBRARY_PATH'])\n"
        )
        folders = said_in(tmp_path, program).split(":")
        assert all(Path(folder).is_absolute() for folder in folders)
        assert [f for f in folders if f.startswith("/opt")] == [f for f in before.split(":") if f]


@pytest.mark.parametrize("importing", ["matplotlib", "mediapipe"])
def test_matplotlib_reads_no_settings_there(tmp_path, importing):
    """42 bytes of them take gigabytes, and a pipe in their place is waited for."""
    pytest.importorskip(importing)
    os.mkfifo(tmp_path / "matplotlibrc")
    program = f"import ico3d, {importing}, matplotlib, os; print(os.path.exists('matplotlibrc'))"
    assert said_in(tmp_path, program) == "True"


def test_pyav_looks_for_no_settings_where_anybody_may_put_them(tmp_path):
    program = "import ico3d, av, os; print(os.environ['GNUTLS_SYSTEM_PRIORITY_FILE'])"
    assert said_in(tmp_path, program) == os.devnull


@pytest.mark.skipif(sys.platform != "linux", reason="what the loader of Linux tells")
def test_espeak_looks_for_no_library_where_its_wheel_was_built(tmp_path):
    """There it may be the folder of another user of the machine."""
    pytest.importorskip("espeakng_loader")
    program = (
        "from ico3d.common.espeak.process import Request, speak\n"
        "print(len(speak(Request('hello', 'en-us', 160, 50, 50)).pcm) > 1000)\n"
    )
    done = run_in(tmp_path, program, LD_DEBUG="libs")
    assert done.stdout.strip() == "True"
    assert "libespeak-ng.so" in done.stderr and "/espeakng-loader/" not in done.stderr


@needs("mediapipe")
def test_mediapipe_gets_no_microphone_for_which_it_would_look_there(tmp_path):
    program = (
        "from ico3d.capture.posing.seeing.mediapipe_body import _imported\n"
        "import sys, pathlib\n"
        "_imported(pathlib.Path('x'))\n"
        "print('sounddevice' in sys.modules)\n"
    )
    assert said_in(tmp_path, program) == "False"


def test_a_module_is_hidden_for_a_while():
    import json

    with hidden("json"), pytest.raises(ImportError):
        import json as again  # noqa: F401
    import json as after

    assert after is json
