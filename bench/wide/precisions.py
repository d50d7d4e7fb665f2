"""Programs in wider precision: a main program and the sources of Rodyn that it uses, compiled with another wp.

What is bound to double precision has a stand-in of the same module in this directory. LAPACK's routines end the program, unless
the main program brings its own.
"""

from __future__ import annotations

import os
import pathlib
import re
import subprocess
from decimal import Decimal

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SOURCES = ROOT / "src" / "rodyn"
#: Decimal digits asked for: `extended` is x86's 80 bits (1e-19) in hardware, `quadruple` 128 bits (1e-34) in software.
DIGITS = {"extended": 18, "quadruple": 33}


def wide_program(precision: str, main: pathlib.Path, *folders: pathlib.Path) -> str:
    """Path of the program, compiled anew if a source is younger. Modules that Rodyn lacks are looked for in `folders`."""
    place = ROOT / "build" / precision
    place.mkdir(parents=True, exist_ok=True)
    generated = {place / path.name: re.sub(r"(:: \wp = )real\d+", rf"\1selected_real_kind({DIGITS[precision]})", path.read_text())
                 for path in (SOURCES / "base/kinds.f90", ROOT / "bench/stability/wide_kind.f90")}
    generated[place / "lapack.c"] = "#include <stdlib.h>\n" + "".join(
        f"void __attribute__((weak)) {name}_(void) {{ abort(); }}\n"
        for name in re.findall(r"end subroutine (d\w+)", (SOURCES / "base/lapack.f90").read_text()))
    for path, text in generated.items():
        if not path.is_file() or path.read_text() != text:
            path.write_text(text)
    modules: dict[str, pathlib.Path] = {}
    for folder in (SOURCES, *folders, HERE, place):
        for path in folder.rglob("*.f90"):
            modules |= dict.fromkeys(re.findall(r"^ *module (\w+)$", path.read_text(), re.MULTILINE), path)
    order: list[pathlib.Path] = []
    put_in_order(main, modules, order)
    program = place / main.stem
    if not program.is_file() or program.stat().st_mtime < max(path.stat().st_mtime for path in [*order, place / "lapack.c"]):
        subprocess.run([os.environ.get("FPM_FC", "mpifort"), "-O2", f"-J{place}", "-o", program, *order, place / "lapack.c"], check=True)
    return str(program)


def put_in_order(path: pathlib.Path, modules: dict[str, pathlib.Path], order: list[pathlib.Path]) -> None:
    """Append the sources that `path` needs, and then itself."""
    for name in re.findall(r"^ *use (\w+)", path.read_text(), re.MULTILINE):
        if modules.get(name, path) not in [path, *order]:
            put_in_order(modules[name], modules, order)
    order.append(path)


def exact(text: str) -> str:
    """The text with each number that has a point or an exponent as all digits of what double precision makes of it."""
    return re.sub(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.])",
                  lambda number: f"{Decimal(float(number[0])):f}" if set(".eE") & set(number[0]) else number[0], text)
