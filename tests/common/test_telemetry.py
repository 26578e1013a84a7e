"""What ico3d stands on reports to nobody."""

import os
import subprocess
import sys

SESSION = """
from pathlib import Path
from ico3d.bundle.format import Bundle
from ico3d.chat.performing.face import open_face
assert open_face(Bundle.open(Path("demo")))[1] is not None
"""


def test_onnxruntime_keeps_no_identifier_and_reports_nothing(tmp_path):
    """Where it reports, it makes an identifier and a queue under the user's cache first."""
    unset = ("CI", "ORT_DISABLE_TELEMETRY", "ORT_RUNNING_UNIT_TESTS", "XDG_CACHE_HOME")
    told = {name: value for name, value in os.environ.items() if name not in unset}
    home = {"HOME": str(tmp_path)}
    subprocess.run([sys.executable, "-c", SESSION], env=told | home, check=True)
    assert not list(tmp_path.rglob("*onnxruntime*"))
