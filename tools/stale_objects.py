"""Have files compiled again that use a module which was compiled after them.

fpm compiles a file when its text changed, or in the same build as a module it uses. A build that ends in its midst leaves files that
were compiled with older definitions, and which the next build would keep. Those lose their digest here, and so are compiled anew.
And fpm never takes out of a library what was once put in: one that holds a file which has been moved or removed is made anew.
"""

from __future__ import annotations

import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[1]


def main() -> None:
    """Look at every build directory."""
    objects_of: dict[str, list[str]] = {}
    used_by: dict[str, set[str]] = {}
    for folder in ("src", "app", "test"):
        for path in sorted((ROOT / folder).rglob("*.[fF]90")):
            text = path.read_text()
            name = str(path.relative_to(ROOT)).replace("/", "_") + ".o"
            used_by[name] = set(re.findall(r"^\s*use (rodyn\w*)", text, re.MULTILINE))
            for module in re.findall(r"^\s*(?:sub)?module (?!procedure)(?:\(\w+\) )?(\w+)", text, re.MULTILINE):
                objects_of.setdefault(module, []).append(name)
    for folder in sorted((ROOT / "build").glob("*/rodyn")):
        made = {path.name: path.stat().st_mtime_ns for path in folder.glob("*.o")}
        for name, modules in used_by.items():
            needed = max((made.get(other, 0) for module in modules for other in objects_of.get(module, [])), default=0)
            if name in made and needed > made[name]:
                (folder / f"{name}.digest").unlink(missing_ok=True)
        for library in folder.glob("lib*.a"):
            held = subprocess.run(["ar", "t", library], capture_output=True, text=True, check=False).stdout.split()
            if set(held) - set(used_by):
                library.unlink()
                (folder / f"{library.name}.digest").unlink(missing_ok=True)


main()
