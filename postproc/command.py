"""What all scripts share on the command line: the file, --out, the exit code, the paths at the end."""

from __future__ import annotations

import argparse
import pathlib
import sys
from collections.abc import Callable, Iterable
from typing import Any

from rodyn_data import DataError


def parser(doc: str, kind: str = "run file") -> argparse.ArgumentParser:
    """A parser with the file and --out; its description is the first line of the script's text."""
    result = argparse.ArgumentParser(description=doc.strip().splitlines()[0])
    result.add_argument("file", type=pathlib.Path, help=kind)
    result.add_argument("-o", "--out", type=pathlib.Path,
                        help="picture: .pdf, .png or .svg; without a suffix both .pdf and .png (default: beside the file)")
    return result


def default_out(arguments: argparse.Namespace, name: str) -> pathlib.Path:
    """`example.h5` -> `example-NAME`, beside the file."""
    if arguments.out:
        return arguments.out
    file = arguments.file
    if file.is_dir():
        return file / name
    return file.with_name(f"{file.stem}-{name}")


def finish(work: Callable[[], Any]) -> int:
    """Do the work, print what was saved; 2 and one line if the file lacks what is needed."""
    try:
        result = work()
    except DataError as error:
        print(error, file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{error.filename or ''}: {error.strerror or error}".removeprefix(": "), file=sys.stderr)
        return 2
    paths: Iterable[pathlib.Path] = getattr(result, "saved", result)
    for path in paths:
        print(path)
    return 0


def pair(text: str) -> tuple[str, str]:
    """'model.inertia=lumped' for --where."""
    key, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"'{text}': write AXIS=VALUE")
    return key.strip(), value.strip()


def add_where(result: argparse.ArgumentParser) -> None:
    result.add_argument("--where", type=pair, action="append", default=[], metavar="AXIS=VALUE",
                        help="only cases with this value on this axis; may be repeated")
    result.add_argument("--time", type=float, help="probe time [s] (default: the last)")
