"""CSV tables: what is read, and what is said of one that cannot be."""

import numpy as np
import pytest

from spume.tables import line_of_row, read_columns, read_csv

TEXT = '\ufeff# who,"where\n\ntime [s], p [kPa]\n0,1\n\n# later\n0.5,2\n'


@pytest.fixture
def file(tmp_path):
    return tmp_path / "table.csv"


def test_names_units_and_numbers(file):
    file.write_text(TEXT, encoding="utf-8")
    names, numbers = read_csv(file)
    assert names == ["time [s]", "p [kPa]"]
    assert numbers.tolist() == [[0.0, 1.0], [0.5, 2.0]]
    assert [line_of_row(file, row) for row in (0, 1)] == [4, 7]
    columns, units = read_columns(file)
    assert columns["p"].tolist() == [1.0, 2.0]
    assert units == {"time": "s", "p": "kPa"}


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("", r"table\.csv: holds no numbers"),
        ("time,p\n", r"table\.csv: holds no numbers"),
        ("time,p\n0,nan\n", r"table\.csv:2: 0,nan: finite numbers are allowed"),
        ("time,p\n0,x\n", r"table\.csv:2: 0,x: numbers are allowed"),
        ("time,p\n0,1\n0.5\n", r"table\.csv:3: 1 numbers under 2 column names"),
        ('time,p\n0,"1\n', r"table\.csv: cannot be read as a CSV file"),
    ],
)
def test_a_table_that_is_given_must_be_whole(file, lines, message):
    file.write_text(lines)
    with pytest.raises(ValueError, match=message):
        read_csv(file)


def test_a_table_that_a_run_writes_may_end_anywhere(file):
    file.write_text("time [s],p [Pa]\n")
    assert [column.tolist() for column in read_columns(file)[0].values()] == [[], []]
    file.write_text("time [s],p [Pa]\n0,nan\n0.1,2\n0.2")
    columns, _ = read_columns(file)
    assert np.array_equal(columns["p"], [np.nan, 2.0], equal_nan=True)
    file.write_text("time [s],p [Pa]\n0\n0.1,2\n")
    with pytest.raises(ValueError, match=r"table\.csv:2: 1 numbers"):
        read_columns(file)


def test_a_file_that_is_not_there_or_no_text(file):
    with pytest.raises(ValueError, match="cannot be read as a CSV file"):
        read_csv(file)
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="cannot be read as a CSV file"):
        read_columns(file)
