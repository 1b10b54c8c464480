import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from outputs.fake_run import make_run
from spume.outputs.reference import Compare, Reference, compare, first_crossing, table
from spume.problems import CaseError
from spume.tables import read_columns


def write_csv(path, header, *columns):
    path.parent.mkdir(exist_ok=True)
    rows = np.column_stack(columns)
    lines = [header] + [",".join(f"{v:.9g}" for v in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def bump(t, arrival=1.0):
    """A pressure that arrives, peaks at 2 (half a unit later) and decays."""
    s = np.maximum(t - arrival, 0.0)
    return 4.0 * np.e * s * np.exp(-2.0 * s)


@pytest.fixture
def folder(tmp_path):
    """A run folder with a gauge in SI units and reference files in units of their own."""
    t = np.linspace(0.0, 1.0, 401)  # seconds; one unit of reference time is 0.2 s
    write_csv(tmp_path / "gauges" / "p.csv", "time [s],pressure [Pa],other [Pa]", t, 3000.0 * bump(t / 0.2), 0 * t)
    r = np.linspace(0.0, 6.0, 61)
    write_csv(tmp_path / "p.csv", "t*,p*,low,high", r, bump(r), 0.9 * bump(r), 1.1 * bump(r))
    write_csv(tmp_path / "late.csv", "t*,p*", r, bump(r, arrival=1.06))
    return tmp_path


def reference(folder, file="p.csv", **options):
    values = {"gauge": "p", "file": str(folder / file), "time_scale": 0.2, "scale": 3000.0} | options
    return Reference(**values)


def test_equal_series_in_different_units_agree(folder):
    [c] = compare([reference(folder, window=(0.5, 4.0), lower="low", upper="high")], folder)
    assert c.rms == pytest.approx(0.0, abs=0.01)
    assert c.max_error == pytest.approx(0.0, abs=0.02)
    assert c.peak == pytest.approx(2.0, abs=1e-3)
    assert c.reference_peak == pytest.approx(2.0, abs=1e-3)
    assert c.peak_band == pytest.approx((1.8, 2.2), abs=1e-3)
    assert c.peak_in_band is True
    assert c.arrival == pytest.approx(c.reference_arrival, abs=0.01)
    assert c.in_band > 0.9
    assert c.coverage == 1.0
    assert c.points == 36
    assert c.shift == 0.0


def test_errors_are_simulation_minus_reference_in_the_references_units(folder):
    [c] = compare([reference(folder, scale=1500.0)], folder)  # a simulation of twice the size
    r = np.linspace(0.0, 5.0, 51)
    assert c.rms == pytest.approx(np.sqrt(np.mean(bump(r) ** 2)), rel=0.02)
    assert c.mean_error == pytest.approx(np.mean(bump(r)), rel=0.02)
    assert c.peak == pytest.approx(4.0, abs=2e-3)


def test_the_part_that_a_run_has_reached_is_reported(folder):
    [c] = compare([reference(folder)], folder)
    assert c.coverage == pytest.approx(51 / 61)
    [c] = compare([reference(folder, window=(5.5, 6.0))], folder)
    assert c.coverage == 0.0
    assert c.rms is None
    assert c.peak is None


def test_one_common_shift_is_found_and_bounded(folder):
    late = reference(folder, "late.csv", shift_max=0.1)
    fixed = reference(folder)
    [a, b] = compare([late, fixed], folder)
    assert a.shift == pytest.approx(0.06, abs=0.002)
    assert a.rms < 0.01
    assert b.shift == 0.0
    assert a.arrival == pytest.approx(b.arrival, abs=0.005)  # arrivals are not moved
    [bounded] = compare([reference(folder, "late.csv", shift_max=0.02)], folder)
    assert bounded.shift == pytest.approx(0.02)
    # Two that allow a shift get the same one.
    [a, b] = compare([late, reference(folder, shift_max=0.1)], folder)
    assert a.shift == b.shift
    assert 0.0 < a.shift < 0.06


def test_a_peak_outside_its_band_is_said_to_be(folder):
    [c] = compare([reference(folder, peak_band=(2.1, 2.3))], folder)
    assert c.peak_in_band is False


def test_first_crossing_upward_and_downward():
    t = np.array([0.0, 1.0, 2.0, 3.0])
    assert first_crossing(t, np.array([0.0, 0.0, 1.0, 0.0]), 0.5) == pytest.approx(1.5)
    assert first_crossing(t, np.array([1.0, 1.0, 0.0, 1.0]), 0.75) == pytest.approx(1.25)
    assert first_crossing(t, np.array([np.nan, 0.0, 0.1, 0.2]), 0.5) is None


def test_the_table_and_the_summary_hold_the_numbers(folder, capsys):
    run = make_run(folder)
    output = Compare([reference(folder, "late.csv", shift_max=0.1, label="p [ρgH]", source="Someone 2014")], ["p"])
    output.start(run)
    output.finish(run)
    printed = capsys.readouterr().out
    for text in ("ρgH", "+0.06", "Someone 2014", "p"):
        assert text in printed
    assert output.results[0].to_json()["rms"] == pytest.approx(output.results[0].rms)
    assert table(output.results).row_count == 1
    narrow = Console(width=50, file=io.StringIO())
    narrow.print(table([replace(output.results[0], reference_peak=1.776, peak_band=(1.77, 2.03))]))
    assert narrow.file.getvalue().count("…") == 1, "the band's own; nothing is cut off"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"column": "q"}, r"column = 'q': one of 't\*', 'p\*', 'low', 'high'"),
        ({"value": "presure"}, "value = 'presure': one of 'pressure', 'other'"),
    ],
)
def test_wrong_columns_are_named(folder, options, message):
    with pytest.raises(ValueError, match=message):
        compare([reference(folder, **options)], folder)


def test_wrong_keys_are_refused(folder):
    with pytest.raises(CaseError, match="give both columns"):
        reference(folder, lower="low")
    with pytest.raises(CaseError, match="from a smaller to a larger time"):
        reference(folder, window=(2.0, 1.0))
    with pytest.raises(ValueError, match="gauge = 'p': one of 'q'"):
        Compare([reference(folder)], ["q"])
    with pytest.raises(CaseError, match="no such file"):
        reference(folder, "nothing.csv")


def test_reference_tables_may_carry_comments(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("# Someone 2014, fig. 3\nt [s],p [Pa]\n0,1\n")
    assert read_columns(path)[1]["p"] == "Pa"


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0,0\n0.1,5\n0.05,3\n0.2,1\n", r"r\.csv:5: time 0\.05 stands after 0\.1; times must not decrease"),
        ("0,0\n# a comment\n0.1,nan\n0.2,1\n", r"r\.csv:5: p = nan: finite numbers are allowed; leave the line out"),
        ("0,0\nnan,5\n", r"r\.csv:4: t = nan: finite"),
        ("0,0\n0.1,inf\n", r"r\.csv:4: p = inf: finite"),
    ],
)
def test_a_table_with_holes_or_without_order_is_refused_with_its_line(tmp_path, rows, message):
    (tmp_path / "r.csv").write_text("# measured\nt,p\n" + rows)
    with pytest.raises(ValueError, match=message):
        reference(tmp_path, "r.csv").load()


def test_instants_may_be_repeated_and_columns_that_are_not_used_have_holes(tmp_path):
    (tmp_path / "r.csv").write_text("t,p,q\n0,0,1\n0.1,5,nan\n0.1,6,nan\n")
    assert reference(tmp_path, "r.csv").load().value.tolist() == [0.0, 5.0, 6.0]
