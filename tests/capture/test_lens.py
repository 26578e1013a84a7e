import numpy as np
import pytest

from ico3d.capture.lens import Lens
from ico3d.errors import CaptureError


@pytest.mark.parametrize("length", [0.0, -5.0, 1e9, 1e308])
def test_no_lens_has_such_a_focal_length(length):
    with pytest.raises(CaptureError, match=r"above 0 and below 1e\+09 pixels"):
        Lens("a", 8, 6, np.diag([500.0, length, 1.0]))
