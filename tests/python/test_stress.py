"""`sigmaik stress`: pieces that resume, with programs that only print. The programs themselves are tested by ctest."""

import csv

import pytest

from sigmaik_lab.__main__ import main
from sigmaik_lab.stress.experiment import CountRow, Plan, missing, run_pieces, totals

# A piece of n cycles has n cases; of seed ...7 one case fails.
PROGRAM = """#!/bin/sh
test "$1" = --table || exit 3
failed=0; again=
case "$3" in *7) failed=1; again="11 12";; esac
echo property,of,cases,failed,worst,again
echo "finite,cycles,$2,0,0,"
echo "limits,joints x cycles,$(($2 * 6)),$failed,$3.5,$again"
"""


@pytest.fixture
def programs(tmp_path):
    folder = tmp_path / "programs"
    folder.mkdir()
    for name in ("sigmaik_stress", "sigmaik_settling"):
        (folder / name).write_text(PROGRAM)
        (folder / name).chmod(0o755)
    return folder


def command(programs, tmp_path, *more):
    file = tmp_path / "counts.csv"
    options = ["--piece", "1000", "--cases", "0", "--programs", str(programs), "--resume", str(file), "--jobs", "1"]
    return main(["stress", *options, "--out", str(tmp_path / "out"), *more]), file


def pieces(file):
    rows = list(csv.DictReader(file.read_text().splitlines()[1:]))
    return [int(row["piece"]) for row in rows if row["property"] == "finite"]


def test_all_pieces_are_counted(programs, tmp_path, capsys):
    code, file = command(programs, tmp_path, "--cycles", "1e4")
    assert code == 0
    assert pieces(file) == list(range(10))
    words = capsys.readouterr().out.split()
    assert "60000" in words  # ten pieces of 1000 cycles, six joints
    assert "10000" in words
    with (tmp_path / "out" / "stress.csv").open() as stream:
        rows = {row["property"]: row for row in csv.DictReader(stream)}
    assert rows["finite"]["failed"] == "0"
    assert rows["limits"]["failed"] == "1"  # of the seed 1000007 alone
    assert rows["limits"]["again"] == "11 12"
    assert float(rows["limits"]["worst"]) == 1000012.5


def test_a_run_resumes_where_it_ended_also_within_a_piece(programs, tmp_path):
    _, file = command(programs, tmp_path, "--cycles", "4e3")
    whole = file.read_text()
    before = whole.splitlines(keepends=True)
    file.write_text("".join(before[:-1]) + before[-1][:10])  # the program was ended while it wrote the last line
    code, _ = command(programs, tmp_path, "--cycles", "4e3")
    assert code == 0
    assert pieces(file) == [0, 1, 2, 3]
    assert [line.split(",")[:8] for line in file.read_text().splitlines()[1:]] == [
        line.split(",")[:8] for line in whole.splitlines()[1:]
    ]
    command(programs, tmp_path, "--cycles", "6e3")  # a longer run of the same seed goes on
    assert pieces(file) == [0, 1, 2, 3, 4, 5]


def test_pieces_that_are_there_are_not_run_again(programs, tmp_path):
    plan = Plan(
        programs, {"sigmaik_stress": 5000, "sigmaik_settling": 5}, {"sigmaik_stress": 1000, "sigmaik_settling": 1}, 1
    )
    file = tmp_path / "counts.csv"
    ran = []
    run_pieces(plan, file, None, 1, ran.append)
    assert len(ran) == 10
    # The programs take turns, so that a part of the run has some of each.
    assert [piece.program for piece in ran[:4]].count("sigmaik_settling") == 2
    again = []
    rows = run_pieces(plan, file, None, 1, again.append)
    assert again == []
    assert missing(plan, rows) == []
    assert {total.program for total in totals(rows)} == {"sigmaik_stress", "sigmaik_settling"}
    assert len({piece.seed for piece in ran if piece.program == "sigmaik_stress"}) == 5


def test_a_file_of_another_program_seed_or_size_is_refused(programs, tmp_path, capsys):
    _, file = command(programs, tmp_path, "--cycles", "2e3")
    assert command(programs, tmp_path, "--cycles", "2e3", "--seed", "2")[0] == 2
    assert command(programs, tmp_path, "--cycles", "4e3", "--piece", "2000")[0] == 2
    (programs / "sigmaik_stress").write_text(PROGRAM + "\n")
    assert command(programs, tmp_path, "--cycles", "2e3")[0] == 2
    assert capsys.readouterr().err.count("is of another study") == 3
    assert pieces(file) == [0, 1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--cycles", "0"], "--cycles"),
        (["--cycles", "nan"], "--cycles"),
        (["--piece", "10"], "--piece"),
        (["--seed", "-1"], "--seed"),
        (["--jobs", "0"], "--jobs"),
        (["--programs", "/nowhere"], "sigmaik_stress is not there: `make build`"),
    ],
)
def test_wrong_options_are_refused(programs, tmp_path, capsys, options, words):
    assert command(programs, tmp_path, *options)[0] == 2
    assert words in capsys.readouterr().err


def test_a_program_that_fails_ends_the_run_and_what_is_done_is_kept(programs, tmp_path, capsys):
    _, file = command(programs, tmp_path, "--cycles", "1e3")
    text = PROGRAM.replace("exit 3", "exit 3\ncase $3 in *5) echo out of luck >&2; exit 4;; esac")
    for name in ("sigmaik_stress",):
        (programs / name).write_text(text)
    file.unlink()
    assert command(programs, tmp_path, "--cycles", "1e4")[0] == 2
    assert "seed 1000005, ended with 4: out of luck" not in pieces(file)
    assert "out of luck" in capsys.readouterr().err
    assert pieces(file) == [0, 1]  # 1000003 and 1000004


def test_rows_hold_numbers_and_texts():
    row = CountRow("sigmaik_stress", 1, "finite", "cycles", 10, 0, 0.0, "", 1.0)
    assert totals([row, row])[0].cases == 20
