"""The layers of src/rodyn: which folder may use which, and the drawing of them in docs/developers.md.

    python tools/layers.py            print what breaks the order (exit 1), or else the drawing and the table
    python tools/layers.py --write    put drawing and table into docs/developers.md
    python tools/layers.py --modules  drawing, and the modules of each layer, as the front page of the API reference (tools/api)
"""

from __future__ import annotations

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
GUIDE = ROOT / "docs" / "developers.md"
BEGIN, END = "<!-- made by tools/layers.py --write -->\n", "<!-- end of what tools/layers.py made -->"

# From bottom to top. A folder may use those of lower rows, and none beside or above it.
ORDER = [
    {"base": "precision, errors, texts, sorting, quadrature, the methods of integration by name, the operating system, LAPACK"},
    {"case": "a case as it is described: its keys, their units, rules and defaults, for files and for the library"},
    {"scene": "a case compiled: rods, hinge laws, loads, spacecraft",
     "ode": "what an integrator needs to know of a system y' = f(t, y), alone and in vector lanes"},
    {"input": "namelists read strictly and written; notes on what is probably unintended",
     "dynamics": "equations of motion: accelerations, events, energies, linearisation, equilibria, modes",
     "integration": "CVODE, ARKODE and our own methods"},
    {"output": "runs and modes as HDF5 files and tables in memory; whether a run stayed where its model holds",
     "simulation": "a motion from start to end: choice of the method, stops at switches and events, ensembles in lanes"},
    {"sweep": "many cases over cores and clusters"},
    {"program": "the commands"},
    {"interface": "the C interface of the shared library, in memory"},
]
# These know less than stands below them: with base they are a library of integrators for any system of equations.
ONLY = {"ode": {"base"}, "integration": {"base", "ode"}}

MODULE = re.compile(r"^ *module +(?!procedure\b|subroutine\b|function\b)(\w+)", re.IGNORECASE | re.MULTILINE)
USE = re.compile(r"^ *(?:use\b(?: *, *non_intrinsic)?[ :]*|submodule *\( *)(rodyn\w*)", re.IGNORECASE | re.MULTILINE)


def may_use(folder: str) -> set[str]:
    """The other folders that a folder may use."""
    below: set[str] = set()
    for row in ORDER:
        if folder in row:
            return below & ONLY.get(folder, below)
        below |= row.keys()
    return set()


def read_uses(root: pathlib.Path = ROOT) -> list[tuple[str, str, str, str]]:
    """Uses of Rodyn's modules in src/rodyn/: place, folder, module that is used, its folder ('' if it is in none)."""
    source = root / "src" / "rodyn"
    texts = {path: path.read_text() for path in sorted(source.rglob("*.[fF]90"))}
    folders = {path: path.parent.relative_to(source).as_posix() for path in texts}
    homes = {found[1].lower(): folders[path] for path, text in texts.items() for found in MODULE.finditer(text)}
    uses = []
    for path, text in texts.items():
        for found in USE.finditer(text):
            place = f"{path.relative_to(root)}:{text.count(chr(10), 0, found.start(1)) + 1}"
            uses.append((place, folders[path], found[1].lower(), homes.get(found[1].lower(), "")))
    return uses


def faults(root: pathlib.Path = ROOT) -> list[str]:
    """What breaks the order, one line each."""
    known = {folder for row in ORDER for folder in row}
    there = {path.parent.relative_to(root / "src" / "rodyn").as_posix() for path in (root / "src" / "rodyn").rglob("*.[fF]90")}
    found = [f"src/rodyn/{folder}: a folder without a layer (ORDER in tools/layers.py)" for folder in sorted(there - known)]
    found += [f"src/rodyn/{folder}: a layer without a folder" for folder in sorted(known - there)]
    for place, folder, module, other in read_uses(root):
        if folder in known and other != folder and other not in may_use(folder):
            found.append(f"{place}: {folder} may not use {module} of {other or 'no folder'}")
    return found


def drawing(width: int = 66) -> str:
    """The layers as a wall: each box stands on those below it."""
    def joint(row: dict[str, str]) -> set[int]:
        return {width * i // len(row) for i in range(len(row) + 1)}

    def ledge(*rows: dict[str, str]) -> str:
        corners = set().union(*map(joint, rows))
        return "".join("+" if i in corners else "-" for i in range(width + 1))

    lines = [ledge(ORDER[-1])]
    for row, below in zip(reversed(ORDER), [*reversed(ORDER[:-1]), ORDER[0]], strict=True):
        lines += ["".join(f"| {folder}".ljust(width // len(row)) for folder in row) + "|", ledge(row, below)]
    return "\n".join(lines)


def table(root: pathlib.Path = ROOT) -> str:
    """What each folder is for and what it does use, from top to bottom."""
    uses = read_uses(root)
    lines = ["| folder | what it is for | uses |", "|---|---|---|"]
    for row in reversed(ORDER):
        for folder, purpose in row.items():
            others = {other for _, user, _, other in uses if user == folder} - {folder}
            names = ", ".join(name for lower in ORDER for name in lower if name in others)
            lines.append(f"| `{folder}/` | {purpose} | {names} |")
    return "\n".join(lines)


def section() -> str:
    """What stands in the guide."""
    return f"```\n{drawing()}\n```\n\n{table()}\n"


def modules(root: pathlib.Path = ROOT) -> str:
    """The drawing, and each layer's modules with the first sentence of their comments; [[...]] is a link of FORD."""
    text = f"```\n{drawing()}\n```\n\nWhat the library offers is in [[rodyn]]; each layer uses those below it.\n"
    for row in reversed(ORDER):
        for folder, purpose in row.items():
            text += f"\n### {folder}: {purpose}\n\n"
            for path in sorted((root / "src" / "rodyn" / folder).glob("*.[fF]90")):
                source = path.read_text()
                comment = re.match(r"(?:!>.+\n)*", source)[0].replace("!>", "").split()
                sentence = re.split(r"(?<=\.) ", " ".join(comment))[0]
                text += "".join(f"- [[{name}]]: {sentence}\n" for name in MODULE.findall(source))
    return text


def main() -> int:
    """Judge, then print or write."""
    found = faults()
    if found:
        print("\n".join(found))
        return 1
    if sys.argv[1:] == ["--modules"]:
        print(modules(), end="")
    elif sys.argv[1:] == ["--write"]:
        before, rest = GUIDE.read_text().split(BEGIN)
        GUIDE.write_text(before + BEGIN + section() + END + rest.split(END)[1])
    else:
        print(section(), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
