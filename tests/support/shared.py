"""Files beside the checkout, too large or not free enough for it; tests that need them are skipped
where they are not.
"""

import os
from pathlib import Path

SHARED = Path(__file__).resolve().parents[3] / "shared"
SPEECH, SUBJECTS = SHARED / "speech", SHARED / "subjects"
MODELS = Path(os.environ.get("ICO3D_MODELS", SHARED / "models"))
