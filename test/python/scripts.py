"""The scripts of postproc/ as commands: in a process of their own, or without loading what this one has loaded."""

import os
import runpy
import subprocess
import sys
import tempfile
import traceback

import matplotlib.pyplot  # noqa: F401  (for `answer`)
import result_files

POSTPROC = result_files.ROOT / "postproc"


def script(name, *arguments):
    program = [sys.executable, str(POSTPROC / f"{name}.py"), *map(str, arguments)]
    return subprocess.run(program, capture_output=True, text=True)


def answer(name, *arguments):
    """The same by a child of this process, which has loaded matplotlib already; to load it takes longer than most answers."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        child = os.fork()
        if not child:
            become_script(str(POSTPROC / f"{name}.py"), [str(argument) for argument in arguments], out, err)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(name, status, out.read(), err.read())


def become_script(path, arguments, out, err):
    """Run a script in this process and end it."""
    status = 1
    try:
        sys.argv, sys.stdout, sys.stderr = [path, *arguments], out, err
        runpy.run_path(path, run_name="__main__")
        status = 0
    except SystemExit as end:
        status = end.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        out.flush()
        err.flush()
        os._exit(status)
