"""Pictures of runs show the numbers of their files, for every kind of scene."""

import re
import time as clock

import animate
import figures
import geometry
import h5py
import histories
import ledger
import namelist
import natural_frequencies
import numpy as np
import phase
import pytest
import result_files
import shape
import spectrum
import style
from geometry import chain, largest_deflection
from matplotlib.text import Text
from PIL import Image
from rodyn_data import DataError, open_run, unit_text


def line_data(axes, label=None):
    """Numbers of the lines with this label, or of all."""
    return [np.asarray(line.get_xydata()) for line in axes.lines if label is None or line.get_label() == label]


DRAWN_QUICKLY = ["n40"]  # a fixed spacecraft; `tools/run` of tools/test draws a free one, and "failed" is below


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=[] if name in DRAWN_QUICKLY else pytest.mark.long) for name in result_files.SCENES
])
def test_every_picture_of_every_scene_is_drawn(runs, tmp_path, monkeypatch, request, name):
    formats = style.FORMATS if request.config.getoption("--all") else (".png",)  # `tools/run` of tools/test draws both
    monkeypatch.setattr(style, "FORMATS", formats)
    paths = figures.plot(runs[name], tmp_path / name)
    assert all(path.stat().st_size > 1000 for path in paths)
    assert {path.suffix for path in paths} == set(formats)
    assert [path.stem for path in paths[::len(formats)]] == [f"{name}-{picture.name}" for picture in figures.pictures(runs[name])]


@pytest.mark.parametrize("name", result_files.SCENES)
def test_a_run_has_the_pictures_that_it_has_data_for(runs, name):
    names = {picture.name for picture in figures.pictures(runs[name])}
    assert {"chain", "shape", "phase"} <= names
    assert ("ledger" in names) == (name != "no_ledger")
    assert ("histories" in names) == (name != "n40")


@pytest.mark.parametrize("name", ["n1", "rigid", *(pytest.param(name, marks=pytest.mark.long) for name in ("n4", "lumped", "failed"))])
def test_histories_show_the_motion_of_the_spacecraft(runs, tmp_path, name):
    figure = histories.plot(runs[name], tmp_path / "x.png")
    with h5py.File(runs[name]) as file:
        shown = [line_data(axes) for axes in figure.axes]
        assert len(shown) == 4
        expected = [("velocity_x", "velocity_y"), ("omega",), ("displacement_x", "displacement_y"), ("rotation",)]
        for lines, names in zip(shown, expected, strict=True):
            for line, quantity in zip(lines, names, strict=False):
                assert np.array_equal(line[:, 0], file["time"][()])
                assert np.array_equal(line[:, 1], file[quantity][()])
    assert [re.sub(r"\$10.*\$ ", "", axes.get_ylabel().rpartition("[")[2]) for axes in figure.axes] == ["m/s]", "rad/s]", "m]", "rad]"]


def test_a_common_factor_of_an_axis_stands_with_its_unit(runs, tmp_path):
    with h5py.File(runs["failed"]) as file:
        largest = np.abs(file["displacement_x"][()]).max()
    axes = histories.plot(runs["failed"], tmp_path / "x.png").axes[2]
    assert largest < 1e-3
    power = int(np.floor(np.log10(largest)))
    assert axes.get_ylabel() == f"$u_x$, $u_y$ [$10^{{{power}}}$ m]"
    assert not axes.yaxis.get_offset_text().get_visible()
    shown = [float(tick.get_text().replace("\N{MINUS SIGN}", "-")) for tick in axes.get_yticklabels()]
    assert np.allclose(np.array(shown) * 10.0**power, axes.get_yticks())


def test_a_failed_run_says_so_in_its_titles(runs, tmp_path):
    for picture in figures.pictures(runs["failed"]):
        figure = picture.plot(tmp_path / "x.png")
        title = (figure.get_suptitle() or figure.axes[0].get_title(loc="left"))
        assert "(failed at t = " in title, picture.name


def test_named_quantities_share_a_panel_with_their_unit(runs, tmp_path):
    figure = histories.plot(runs["n4"], tmp_path / "x.png", ["phi(1)", "alpha(4)", "energy_kinetic"])
    assert [len(axes.lines) for axes in figure.axes[:2]] == [2, 1]
    with h5py.File(runs["n4"]) as file:
        assert np.array_equal(line_data(figure.axes[0])[1][:, 1], file["alpha"][:, 3])


def test_shapes_stand_on_the_nodes_and_bend_as_stated(runs, tmp_path):
    figure = shape.plot(runs["n4"], tmp_path / "x.png", [0.4], magnification=25)
    assert "t = 0.4 s" in figure.axes[0].get_title(loc="left") and "× 25" in figure.axes[0].get_title(loc="left")
    with h5py.File(runs["n4"]) as file:
        row = int(np.argmin(np.abs(file["time"][()] - 0.4)))
        phi, alpha, beta = (file[name][row] for name in ("phi", "alpha", "beta"))
    (curve,) = line_data(figure.axes[0], "t = 0.4 s")
    curve = curve.reshape(4, -1, 2)
    node = np.array([0.4, 0.1])
    for k in range(4):
        e, n = np.array([np.cos(phi[k]), np.sin(phi[k])]), np.array([-np.sin(phi[k]), np.cos(phi[k])])
        s = np.linspace(0, 1.2, curve.shape[1])
        v = 25 * (s * (1 - s / 1.2) ** 2 * alpha[k] - s**2 / 1.2 * (1 - s / 1.2) * beta[k])
        assert np.allclose(curve[k], node + s[:, None] * e + v[:, None] * n, atol=1e-12)
        node = node + 1.2 * e
    assert np.abs(v).max() > 0


def test_slopes_of_a_rod_are_its_end_angles():
    length, alpha, beta = np.array([2.0]), np.array([0.01]), np.array([-0.02])
    _, rods = chain(np.zeros(2), length, np.zeros(1), alpha, beta, 1.0)
    x, y = rods[0].T
    cubic = np.polynomial.Polynomial.fit(x, y, 3)
    assert np.allclose([cubic.deriv()(0.0), cubic.deriv()(2.0)], [0.01, -0.02], atol=1e-12)
    assert np.allclose([cubic(0.0), cubic(2.0)], 0.0, atol=1e-12)


def test_the_inertial_frame_turns_the_moving_one(runs, tmp_path):
    moving = shape.plot(runs["rigid"], tmp_path / "a.png", [0.5])
    inertial = shape.plot(runs["rigid"], tmp_path / "b.png", [0.5], frame="inertial")
    with h5py.File(runs["rigid"]) as file:
        u = np.array([file["displacement_x"][-1], file["displacement_y"][-1]])
        theta = file["rotation"][-1]
    turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    (a,), (b,) = (line_data(figure.axes[0], "t = 0.5 s") for figure in (moving, inertial))
    assert np.allclose(b, (a + u) @ turn.T, atol=1e-12)
    assert abs(theta) > 1e-3


def test_marks_stand_for_hinges_and_for_nodes_with_mass(runs, tmp_path):
    def marks(name):
        axes = shape.plot(runs[name], tmp_path / "x.png", [0.0]).axes[0]
        return [text.get_text() for text in axes.get_legend().get_texts()]

    assert marks("n4") == ["$t$ = 0 s", "hinge", "node mass"]
    assert marks("n40") == ["$t$ = 0 s", "hinge"]


def test_times_outside_the_run_are_refused(runs, tmp_path):
    with pytest.raises(DataError, match=r"no row at t = 3 s: it has 201 rows, 0 to 0.5 s"):
        shape.plot(runs["n4"], tmp_path / "x.png", [3.0])


def test_the_articles_largest_deflection_is_found(tmp_path):
    text = (result_files.ROOT / "cases" / "example.nml").read_text()
    (tmp_path / "e.nml").write_text(text.replace("t_end = 2 ", "t_end = 0.4 ").replace("n_outputs = 2000", "n_outputs = 4"))
    result_files.subprocess.run([result_files.RODYN, "run", str(tmp_path / "e.nml"), "--output", str(tmp_path / "e.h5")], check=True)
    with open_run(tmp_path / "e.h5") as run:
        assert abs(largest_deflection(run, run.nearest_row(0.4)) - 0.0153) < 1e-4


def test_an_animation_reads_out_its_times(runs, tmp_path):
    figure = animate.plot(runs["n4"], tmp_path / "x.gif", seconds=1.0, fps=10)
    with Image.open(tmp_path / "x.gif") as picture:
        assert picture.n_frames == 10
    assert np.allclose(figure.times, np.linspace(0, 0.5, 10), atol=0.0015)
    assert figure.axes[0].get_title(loc="left").endswith("t = 0.500 s, inertial frame, bending × 1")


@pytest.mark.parametrize("name", ["n1", "n40", "failed"])
def test_other_scenes_are_animated(runs, tmp_path, name):
    animate.plot(runs[name], tmp_path / "x.gif", seconds=0.3, fps=10)
    with Image.open(tmp_path / "x.gif") as picture:
        assert picture.n_frames >= 1


def test_an_mp4_without_ffmpeg_is_refused_in_words(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(animate.shutil, "which", lambda name: None)
    with pytest.raises(DataError, match="needs the program ffmpeg"):
        animate.plot(runs["n1"], tmp_path / "x.mp4")


def test_phase_portraits_pair_a_quantity_with_its_rate(runs, tmp_path):
    figure = phase.plot(runs["n4"], tmp_path / "x.png", ["phi(2)", "rotation"])
    with h5py.File(runs["n4"]) as file:
        assert np.array_equal(line_data(figure.axes[0])[0], np.stack([file["phi"][:, 1], file["phi_rate"][:, 1]], axis=1))
        assert np.array_equal(line_data(figure.axes[1])[0], np.stack([file["rotation"][()], file["omega"][()]], axis=1))
    with pytest.raises(DataError, match="'omega' has no rate"):
        phase.plot(runs["n4"], tmp_path / "x.png", ["omega"])


@pytest.mark.parametrize("script", [histories, phase])
def test_titles_keep_to_their_own_side(runs, tmp_path, script):
    quantities = ["phi(1)", "phi(4)"]
    figure = script.plot(runs["n4"], tmp_path / "p.png", quantities)
    figure.draw_without_rendering()
    titles = [text for axes in figure.axes for text in axes.findobj(Text) if text.get_text() and text.get_text() == axes.get_title(loc="left")]
    boxes = [title.get_window_extent() for title in titles]
    assert len(boxes) == len(figure.axes)
    assert all(box.x1 <= figure.bbox.x1 for box in boxes)
    assert not any(one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[:i])


def test_the_ledger_shows_the_size_of_the_residual(runs, tmp_path):
    figure = ledger.plot(runs["n1"], tmp_path / "x.png")
    residual = figure.axes[1]
    assert residual.get_yscale() == "log"
    with h5py.File(runs["n1"]) as file:
        expected = np.abs(file["energy_residual"][()])
        shown = line_data(residual)[0]
        assert np.array_equal(shown[expected > 0, 1], expected[expected > 0])
        assert np.array_equal(line_data(figure.axes[0])[3][:, 1], file["work_external"][()])
        assert np.array_equal(line_data(figure.axes[3])[0][:, 1], file["angular_momentum"][()])


def test_a_run_without_ledger_is_told(runs, tmp_path):
    with pytest.raises(DataError, match=r"no data set 'energy_kinetic'; the case was run with ledger = \.false\."):
        ledger.plot(runs["no_ledger"], tmp_path / "x.png")


def test_a_spectrum_finds_the_amplitude_of_a_sine():
    time = np.linspace(0, 20, 4001)
    omega, amplitude = spectrum.amplitudes(time, 0.3 * np.sin(25.13 * time) + 2.0 + 0.1 * time)
    peak = np.argmax(amplitude)
    assert abs(omega[peak] - 25.13) < np.pi / 10
    assert abs(amplitude[peak] - 0.3) < 0.05


def test_a_spectrum_marks_the_natural_frequencies(runs, tmp_path):
    figure = spectrum.plot(runs["n1"], tmp_path / "x.png", ["phi(1)"], start=0.3)
    with open_run(runs["n1"]) as run:
        frequencies = natural_frequencies.natural_frequencies(run)
    marked = [line[0, 0] for line in line_data(figure.axes[0])[1:]]
    low, high = figure.axes[0].get_xlim()
    assert marked == [f for f in frequencies if low <= f <= high]


def test_natural_frequencies_of_the_main_scene(tmp_path):
    """Against those of the documentation of the model."""
    text = (result_files.ROOT / "cases" / "table1.nml").read_text()
    (tmp_path / "t.nml").write_text(text.replace("t_end = 30 ", "t_end = 1e-3 ").replace("n_outputs = 3000", "n_outputs = 1"))
    result_files.subprocess.run([result_files.RODYN, "run", str(tmp_path / "t.nml"), "--output", str(tmp_path / "t.h5")], check=True)
    with open_run(tmp_path / "t.h5") as run:
        found = natural_frequencies.natural_frequencies(run)
    expected = [12.665, 29.634, 64.694, 109.807, 466.93, 573.07, 729.55, 883.28, 2059.6, 2267.4, 2564.5, 2820.4]
    assert np.allclose(found, expected, rtol=2e-4)


def test_bubbles_are_in_the_file_balance_and_are_drawn(tmp_path):
    """One rod clamped by a strong spring and plucked: three shapes, against the program's own frequency."""
    (tmp_path / "b.nml").write_text(
        "&case title = 'bubble', t_end = 0.05, n_outputs = 50 /\n&spacecraft motion = 'fixed' /\n"
        "&chain n_rods = 1, length = 2.0, mass_per_length = 1.5, bending_stiffness = 100.0, hinge_stiffness = 1e4 /\n"
        "&model bending_shapes = 3, gauss_points = 5 /\n&initial bubble = 0.02 /\n")
    result_files.subprocess.run([result_files.RODYN, "run", str(tmp_path / "b.nml"), "--output", str(tmp_path / "b.h5")], check=True)
    with h5py.File(tmp_path / "b.h5") as file:
        assert file["bubble"][0, 0] == 0.02
        assert np.abs(file["bubble_rate"]).max() > 0.1
        assert np.abs(file["energy_residual"]).max() < 1e-6 * file["energy_elastic"][0]
        assert np.isclose(file["energy_elastic"][0], 0.5 * 204.8 * 100.0 / 2.0**3 * 0.02**2)
    with open_run(tmp_path / "b.h5") as run:
        assert np.isclose(largest_deflection(run, 0), 0.02)
        found = natural_frequencies.natural_frequencies(run)
        highest = float(re.search(r"frequencies to ([\d.E+-]+) rad/s", run.solver()["reason"])[1])
    assert np.isclose(found[-1], highest, rtol=0.1)


@pytest.mark.parametrize("name", ["rigid", "lumped", "n40", "n1"])
def test_natural_frequencies_agree_with_the_programs(runs, name):
    """The program names the highest frequency, good to a tenth, when it chooses a method."""
    with open_run(runs[name]) as run:
        found = natural_frequencies.natural_frequencies(run)
        reason = run.solver()["reason"]
    match = re.search(r"frequencies to ([\d.E+-]+) rad/s", reason)
    assert match, reason
    assert np.isclose(found[-1], float(match[1]), rtol=0.1)


@pytest.mark.parametrize("model", ["bending = 'quasistatic'", "inertia = 'lumped', bending = 'quasistatic'"])
def test_natural_frequencies_are_those_of_the_modes(tmp_path, model):
    (tmp_path / "m.nml").write_text(result_files.case("Frequencies", 3, model, t_end=0.01, n_outputs=1))
    for command in (["run", "m.nml"], ["modes", "m.nml"]):
        result_files.subprocess.run([result_files.RODYN, *command, "--quiet"], cwd=tmp_path, check=True)
    with open_run(tmp_path / "m.h5") as run, h5py.File(tmp_path / "m_modes.h5") as modes:
        expected = modes["frequency"][modes["frequency"][()] > 1e-6]
        assert np.allclose(natural_frequencies.natural_frequencies(run), expected, rtol=1e-8)


def test_the_path_of_the_tip_is_that_of_the_drawn_tip(tmp_path):
    (tmp_path / "t.nml").write_text(result_files.case("Bent", 2, "bending_shapes = 3, gauss_points = 5", t_end=0.02, n_outputs=4)
                                    + "&initial phi = 0.3, 0.8, alpha = 0.5, 0.2, beta = -0.5, 0.1, bubble = 0.05, -0.1 /\n")
    result_files.subprocess.run([result_files.RODYN, "run", "t.nml", "--quiet"], cwd=tmp_path, check=True)
    with open_run(tmp_path / "t.h5") as run:
        for frame in ("moving", "inertial"):
            _, path = geometry.tip_path(run, frame)
            drawn = [shape.nodes[-1] for shape in geometry.shapes(run, np.arange(run.time.size), frame=frame)]
            assert np.allclose(path, drawn, rtol=0, atol=1e-13)
            assert frame == "inertial" or np.hypot(*(path[0] - geometry.Place(run).hinge)) < 2.4  # two rods of 1.2 m


def test_a_long_line_keeps_its_peaks():
    x = np.linspace(0, 1, 1_000_003)
    y = np.sin(40 * x)
    y[[123_456, 654_321]] = 5.0, -6.0
    thin_x, thin_y = style.envelope(x, y)
    assert thin_x.size <= 4000 and np.all(np.diff(thin_x) > 0)
    assert thin_y.max() == 5.0 and thin_y.min() == -6.0
    assert thin_x[0] == 0.0 and thin_x[-1] == 1.0
    y[10:20_000] = np.nan
    assert np.nanmax(style.envelope(x, y)[1]) == 5.0


@pytest.mark.parametrize("script", [histories, shape, phase, ledger, spectrum])
def test_a_run_file_of_100_megabytes_is_plotted_in_ten_seconds(runs, tmp_path_factory, script):
    directory = tmp_path_factory.getbasetemp()
    path = directory / "large.h5"
    if not path.exists():
        result_files.write_large_run(path, runs["n4"], 100)
    assert path.stat().st_size > 100_000_000
    start = clock.process_time()  # others may work beside this test
    figure = script.plot(path, directory / script.__name__)
    assert clock.process_time() - start < 10.0
    if script is histories:
        for axes in figure.axes:
            for line in line_data(axes):
                assert line[:, 1].max() == 7.0 and line.shape[0] <= 4000


def test_the_namelist_of_a_file_is_read(runs):
    text = "&a x = 3*1.5E+000, 2 ! words, 'x'\n t = 'it''s / & = !' /\n! &b\n&b flag = .true. / &b flag=F, k = -1d-3/"
    assert namelist.read_namelist(text) == {
        "a": [{"x": [1.5, 1.5, 1.5, 2], "t": "it's / & = !"}], "b": [{"flag": True}, {"flag": False, "k": -1e-3}],
    }
    with open_run(runs["n4"]) as run:
        assert run.per_rod("length").tolist() == [1.2] * 4
        assert len(run.scene()["load"]) == 2 and run.group("model")["formulation"] == "paper"


def test_units_are_written_as_in_print():
    units = ["rad s-1", "kg m2 s-1", "J", "", "s-1", "N m s rad-1"]
    assert [unit_text(u) for u in units] == ["rad/s", "kg m²/s", "J", "", "1/s", "N m s/rad"]
