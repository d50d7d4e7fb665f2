"""Tables and reports hold the numbers of their files; every script speaks clearly on the command line."""

import functools
import html.parser
import os
import pathlib
import re
import shutil
import subprocess
import sys

import figures
import h5py
import numpy as np
import pytest
import report
import result_files
import tables
from rodyn_data import DataError
from scripts import POSTPROC, answer, script

RUN_SCRIPTS = ["histories", "shape", "animate", "phase", "ledger", "spectrum", "figures", "report"]
SWEEP_SCRIPTS = ["sweep_lines", "exact_lumped", "heat_map", "convergence"]
BROWSED = ["n1", "inertia_failed"]
BROWSER = os.environ.get("RODYN_BROWSER") or shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.fixture(scope="module")
def table_run(tmp_path_factory):
    directory = tmp_path_factory.mktemp("table1")
    text = (result_files.ROOT / "cases" / "table1.nml").read_text()
    (directory / "t.nml").write_text(text.replace("t_end = 30 ", "t_end = 1 ").replace("n_outputs = 3000", "n_outputs = 1"))
    subprocess.run([result_files.RODYN, "run", str(directory / "t.nml"), "--output", str(directory / "t.h5")], check=True)
    return directory / "t.h5"


def test_table_1_has_ours_beside_the_printed(table_run, tmp_path):
    written = tables.plot(table_run, tmp_path / "tables")
    (table,) = written.tables
    assert table.title.startswith("Table 1")
    cells = [dict(zip(table.head, row, strict=True)) for row in table.rows]
    assert [c["article"] for c in cells] == ["0.49135614", "0.39531 … 0.39535"]
    with h5py.File(table_run) as file:
        ours = file["phi"][-1, 3], file["alpha_rate"][-1, 0]
    assert [float(c["Rodyn"]) for c in cells] == [round(v, 12) for v in ours]
    assert abs(float(cells[0]["Rodyn"]) - 0.491356055226) < 1e-10
    text = (tmp_path / "tables.md").read_text()
    assert r"| $\varphi_{4}$, rad | 1 | 0.491356055" in text
    latex = (tmp_path / "tables.tex").read_text()
    assert latex.count("\\\\") == 3 and "\\toprule" in latex and "0.49135614" in latex and "…" not in latex and "−" not in latex


def test_table_3_has_differences_of_both(sweeps, tmp_path):
    written = tables.plot([sweeps["inertia_failed"]], tmp_path / "t.md")
    (table,) = written.tables
    assert written.saved == [tmp_path / "t.md"]
    rows = {tuple(row[:3]): row[3:] for row in table.rows}
    assert len(rows) == 30
    assert rows["2", "article", "exact"] == ["−16.436", "21.920", "–", "4.046", "0.194"]
    assert rows["2", "article", "exact − lumped"] == ["1.686", "4.760", "–", "0.006", "0.002"]
    assert rows["8", "Rodyn", "exact"][1] == f"{np.degrees(-0.5):.3f}".replace("-", "−")
    assert rows["8", "Rodyn", "exact − lumped"][1] == f"{np.degrees(0.05):.3f}"
    assert rows["4", "Rodyn", "lumped"] == ["failed"] * 5
    assert rows["4", "Rodyn", "exact"][-1] == "–"  # no series
    assert rows["4", "Rodyn", "exact"][0] == f"{np.degrees(-0.25):.3f}".replace("-", "−")


def test_a_sweep_of_steps_gives_a_range(tmp_path):
    phi = np.array([0.01360950, 0.01360953])[:, None, None] * np.array([1, 1, 1, 1.0])
    path = result_files.write_sweep(tmp_path / "s.h5", {"case.n_outputs": [100, 200]}, phi, probe_times=[30.0])
    (table,) = tables.plot(path, tmp_path / "t.md").tables
    assert table.title.startswith("Table 2") and table.rows[0][2] == "0.01360950000 … 0.01360953000"


def test_files_without_anything_for_the_tables_are_told(runs, tmp_path):
    with pytest.raises(DataError, match="nothing for the article's tables: no row at t = 1, 30, 60, 120, 240 s"):
        tables.plot(runs["n4"], tmp_path / "t")


class Page(html.parser.HTMLParser):
    """Addresses and texts of a page."""

    def __init__(self, text):
        super().__init__()
        self.addresses, self.tags, self.text = [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "action", "data", "srcset")]

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def reports(runs, sweeps, tmp_path_factory, request):
    """Reports by the name of a run or a sweep, each made once; "n1" with an animation. Those that a browser opens have all pictures."""
    place = tmp_path_factory.mktemp("reports")

    @functools.cache
    def made(name):
        with pytest.MonkeyPatch.context() as patch:
            if name not in BROWSED and not request.config.getoption("--all"):  # the pictures themselves are tested elsewhere
                patch.setattr(report, "pictures", lambda file: figures.pictures(file)[:1])
            patch.setattr(report.animate, "plot", functools.partial(report.animate.plot, seconds=0.5))
            (path,) = report.plot((runs | sweeps)[name], place / f"{name}.html", animation=name == "n1")
        return path

    return made


@pytest.mark.parametrize("name", result_files.SCENES)
def test_a_report_of_a_run_needs_nothing_else(runs, reports, name):
    text = reports(name).read_text(encoding="utf-8")
    page = Page(text)
    assert page.addresses and all(address.startswith("data:image/") for address in page.addresses)
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    with h5py.File(runs[name]) as file:
        assert file.attrs["input"].decode().strip() in page.text
        assert file.attrs["compiler_options"].decode() in page.text
        assert f"{file['phi'][:, 0].max():.6g}".replace("-", "−") in page.text or not np.any(file["phi"][:, 0])
        if name == "failed":
            assert "This run is not complete: failed" in page.text
            assert file.attrs["message"].decode() in page.text
    assert ("data:image/gif;base64" in text) == (name == "n1")
    assert "Not drawn" not in page.text


@pytest.mark.parametrize("name", ["inertia", "inertia_failed", "grid", "orders", "all_failed"])
def test_a_report_of_a_sweep_lists_its_failures(reports, name):
    page = Page(reports(name).read_text(encoding="utf-8"))
    failures = {"inertia": 0, "inertia_failed": 1, "grid": 3, "orders": 1, "all_failed": 3}[name]
    assert page.text.count("step size too small") == failures
    assert page.addresses or name == "all_failed"


@pytest.mark.parametrize("name", BROWSED)
def test_a_report_opens_in_a_browser(reports, tmp_path, name):
    assert BROWSER, "no Chromium on the PATH: install one, or name it in RODYN_BROWSER"
    path = reports(name)
    quiet = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
             "--disable-component-update", "--disable-sync", f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1000,1400"]
    picture = tmp_path / "page.png"
    subprocess.run([BROWSER, *quiet, f"--screenshot={picture}", path.as_uri()], check=True, capture_output=True, timeout=120)
    from PIL import Image
    with Image.open(picture) as shot:
        colours = np.asarray(shot.convert("RGB")).reshape(-1, 3)
    assert (colours == [255, 255, 255]).all(axis=1).mean() > 0.5
    # A line of the first picture in the palette's blue: the embedded pictures are shown.
    assert (np.abs(colours - np.array([0x00, 0x72, 0xB2])).max(axis=1) < 12).sum() > 100
    dom = subprocess.run([BROWSER, *quiet, "--dump-dom", path.as_uri()], check=True, capture_output=True, text=True, timeout=120).stdout
    assert Page(dom).tags.count("figure") == Page(path.read_text(encoding="utf-8")).tags.count("figure")


@pytest.mark.parametrize("name", [*RUN_SCRIPTS, *SWEEP_SCRIPTS, "mode_shapes", "work_precision", "stiffness", "tables"])
def test_a_file_that_is_none_ends_with_one_line_and_exit_code_2(tmp_path, name):
    (tmp_path / "text.h5").write_text("not HDF5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1.0
    for file in ("missing.h5", "text.h5", "other.h5"):
        result = answer(name, tmp_path / file)
        assert result.returncode == 2, result.stderr
        assert result.stdout == "" and len(result.stderr.splitlines()) == 1
        assert str(tmp_path / file) in result.stderr


@pytest.mark.parametrize("name", SWEEP_SCRIPTS)
def test_a_run_is_no_sweep(runs, name):
    result = answer(name, runs["n1"])
    assert result.returncode == 2 and "is a run file; this script reads sweep files" in result.stderr


@pytest.mark.parametrize("name", ["histories", "ledger"])
def test_a_sweep_is_no_run(sweeps, name):
    result = answer(name, sweeps["inertia"])
    assert result.returncode == 2 and "is a sweep file; this script reads run files" in result.stderr


def test_the_directory_of_a_sweep_is_no_run(sweeps, tmp_path):
    (tmp_path / "sweep.h5").write_bytes(sweeps["inertia"].read_bytes())
    result = answer("histories", tmp_path)
    assert result.returncode == 2 and "is the directory of a sweep; this script reads run files" in result.stderr


@pytest.mark.parametrize(("name", "kind", "options"), [
    ("histories", "n4", ["--quantity", "phi(4)", "omega"]), ("shape", "n4", ["--times", "0", "0.4", "-m", "25", "--frame", "inertial"]),
    ("animate", "n1", ["--seconds", "0.3"]), ("phase", "n4", ["--x", "phi(4)", "--y", "omega"]), ("ledger", "n1", []),
    ("spectrum", "n1", ["--quantity", "omega", "--start", "0.1", "--highest", "200"]),
    ("sweep_lines", "inertia", ["--quantity", "n_rhs", "--where", "model.inertia=lumped", "--time", "1"]),
    ("exact_lumped", "inertia", ["--axis", "mass_ratio"]),
    ("heat_map", "grid", ["--axes", "mass_ratio", "chain.hinge_stiffness(0)"]),
    ("convergence", "orders", ["--axis", "solver.fixed_step", "-q", "phi(1)", "--reference", "0.25"]),
])
def test_scripts_print_the_paths_they_wrote(runs, sweeps, tmp_path, request, name, kind, options):
    both = name in ("histories", "sweep_lines", "heat_map") or (name != "animate" and request.config.getoption("--all"))
    names = ["x.pdf", "x.png"] if both else ["x.gif" if name == "animate" else "x.png"]
    command = script if name in ("histories", "sweep_lines") else answer
    result = command(name, (runs | sweeps)[kind], "--out", tmp_path / ("x" if both else names[0]), *options)
    assert result.returncode == 0, result.stderr
    paths = [pathlib.Path(line) for line in result.stdout.splitlines()]
    assert [p.name for p in paths] == names
    assert all(p.stat().st_size > 1000 for p in paths)


def test_wrong_names_are_answered_in_words(runs, sweeps):
    for name, file, options, words in [
        ("histories", runs["n4"], ["-q", "phi(5)"], "no rod 5: there are rods 1 to 4"),
        ("histories", runs["n4"], ["-q", "phi"], "write phi(1) to phi(4)"),
        ("histories", runs["n4"], ["-q", "omega(1)"], "does not belong to a rod"),
        ("histories", runs["n4"], ["-q", "speed"], "no data set 'speed'; it has alpha, "),
        ("histories", runs["n4"], ["-q", "a b"], "'a b' is no quantity"),
        ("ledger", runs["no_ledger"], [], "the case was run with ledger = .false."),
        ("convergence", sweeps["grid"], [], "none of solver.fixed_step"),
    ]:
        result = answer(name, file, *options)
        assert result.returncode == 2 and words in result.stderr, result.stderr


def test_scripts_start_fast():
    seconds = re.findall(r"(\d+) \| +\S*pyplot", subprocess.run(
        [sys.executable, "-X", "importtime", str(POSTPROC / "histories.py"), "--help"], capture_output=True, text=True).stderr)
    assert seconds == []  # pyplot is not loaded
