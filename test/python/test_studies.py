"""postproc/studies.py on the article's table 3 as it ships, and on a file that is no such study."""

import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
RODYN = os.environ.get("RODYN", str(ROOT / "bin" / "rodyn"))
STUDIES = [sys.executable, str(ROOT / "postproc" / "studies.py")]


def study(name: str, file: pathlib.Path) -> subprocess.CompletedProcess:
    return subprocess.run([*STUDIES, name, str(file)], capture_output=True, text=True, check=False)


def test_table_3_stands_beside_the_articles(tmp_path):
    sweep = ["sweep", str(ROOT / "cases" / "sweep_table3.nml"), "--output", str(tmp_path / "s"), "--quiet"]
    subprocess.run([RODYN, *sweep], check=True)
    result = study("table3", tmp_path / "s" / "sweep.h5")
    assert result.returncode == 0, result.stderr
    rows = [line.split() for line in result.stdout.splitlines()[1:]]
    assert [row[:2] for row in rows] == [[str(ratio), kind] for ratio in (2, 4, 8, 16, 32) for kind in ("exact", "lumped")]
    # The claim: exact and lumped come together as the nodes grow heavy.
    gaps = [abs(float(exact[3]) - float(lumped[3])) for exact, lumped in zip(rows[::2], rows[1::2], strict=True)]
    assert gaps[-1] < 0.2 * gaps[0]
    # The argument: at ratio 32 the article's angles hold more energy than the loads supply.
    assert float(rows[-2][-1]) > 5000.0 > float(rows[-2][6])
    wrong = study("table1", tmp_path / "s" / "sweep.h5")
    assert wrong.returncode == 0
    missing = study("table2", tmp_path / "s" / "sweep.h5")
    assert missing.returncode == 2
    assert "no probe time 30 s" in missing.stderr
