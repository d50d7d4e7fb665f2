"""rodyn-plot SCRIPT [ARGUMENTS]: the scripts of postproc/, as `rodyn-plot histories run.h5`."""

from __future__ import annotations

import importlib
import sys

from ._case import scripts


def main() -> None:
    """Run a script as `python postproc/SCRIPT.py` would."""
    folder = scripts()
    names = sorted(path.stem for path in folder.glob("*.py") if "__main__" in path.read_text(encoding="utf-8"))
    if len(sys.argv) < 2 or sys.argv[1] not in names:
        print(f"usage: rodyn-plot SCRIPT [ARGUMENTS]\nscripts: {', '.join(names)}", file=sys.stderr)
        sys.exit(2)
    sys.path.insert(0, str(folder))
    name = sys.argv[1]
    sys.argv = [f"rodyn-plot {name}", *sys.argv[2:]]
    sys.exit(importlib.import_module(name).main())
