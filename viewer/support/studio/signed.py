"""Prints what tells somebody's recordings from others, as a making keeps it.

Run: python signed.py FOLDER
"""

import json
import sys
from pathlib import Path

from ico3d.recording.keeping.person import Person
from ico3d.recording.making.sources import Recorded, signature

if __name__ == "__main__":
    print(json.dumps(signature(Recorded.of(Person(Path(sys.argv[1]))).sources)))
