"""What `pip install ./postproc` calls: package, shared library, header and scripts as a wheel (PEP 517), by Python alone."""

from __future__ import annotations

import base64
import hashlib
import pathlib
import re
import subprocess
import sysconfig
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent
LIBRARY = ROOT / "build" / "stage-release" / "lib" / "librodyn.so"
VERSION = re.search(r'^version = "(.+)"', (ROOT / "fpm.toml").read_text(), re.MULTILINE)[1]
METADATA = f"""\
Metadata-Version: 2.1
Name: rodyn
Version: {VERSION}
Summary: Nonlinear planar dynamics of a chain of elastic rods on a free-floating spacecraft
License: MIT
Requires-Python: >=3.10
Requires-Dist: numpy
Requires-Dist: xarray
Provides-Extra: plot
Requires-Dist: h5py; extra == 'plot'
Requires-Dist: matplotlib; extra == 'plot'
"""
ENTRY_POINTS = "[console_scripts]\nrodyn-plot = rodyn.plot:main\n"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None) -> str:
    """The library is that of tools/build, which is called if it has not been."""
    if not LIBRARY.exists():
        subprocess.run([ROOT / "tools" / "build"], check=True)
    tag = f"py3-none-{re.sub('[-.]', '_', sysconfig.get_platform())}"
    name, info = f"rodyn-{VERSION}-{tag}.whl", f"rodyn-{VERSION}.dist-info"
    files = {f"rodyn/{path.name}": path.read_bytes() for path in sorted((HERE / "rodyn").glob("*.py"))}
    files |= {f"rodyn/scripts/{path.name}": path.read_bytes() for path in sorted(HERE.glob("*.py")) if path.name != "rodyn_wheel.py"}
    files |= {f"rodyn/{path.name}": path.read_bytes() for path in (LIBRARY, ROOT / "src" / "rodyn" / "interface" / "rodyn.h")}
    files |= {f"{info}/METADATA": METADATA.encode(), f"{info}/entry_points.txt": ENTRY_POINTS.encode()}
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: rodyn\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    record = "".join(f"{path},{_digest(content)},{len(content)}\n" for path, content in files.items())
    files[f"{info}/RECORD"] = f"{record}{info}/RECORD,,\n".encode()
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, content in files.items():
            wheel.writestr(path, content)
    return name


def _digest(content: bytes) -> str:
    return "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
