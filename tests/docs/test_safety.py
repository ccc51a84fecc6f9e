"""The table of docs/safety.md, requirement → code → test, names what the source has."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/safety.md").read_text(encoding="utf-8")
ROWS = [line.strip("|").split(" | ") for line in PAGE.splitlines() if re.match(r"\| R\d+\. ", line)]


def test_the_rows_are_numbered_one_after_the_other():
    numbers = [int(re.match(r"\s*R(\d+)\.", row[0])[1]) for row in ROWS]
    assert numbers == list(range(1, len(ROWS) + 1))
    assert len(numbers) >= 25


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0].split(".")[0].strip())
def test_a_row_names_code_and_a_test_that_exist(row):
    _, code, test = (cell.strip() for cell in row)
    for cell, folders in ((code, ("cpp", "bindings", "python")), (test, ("tests",))):
        file, *names = re.findall(r"`([^`]+)`", cell)
        assert file.split("/")[0] in folders
        text = (ROOT / file).read_text(encoding="utf-8")
        titles = re.findall(r'"([^"]+)"', cell)
        for name in names:
            assert re.search(rf"\b{name}\b", text), f"{name} is not in {file}"
        for title in titles:
            assert re.search(rf'TEST_CASE\(\s*"{re.escape(title)}"', text), f"no test of {file} is called: {title}"
        if cell is test:
            assert names or titles
            assert all(f"def {name}(" in text for name in names)


def test_the_page_says_what_it_does_not_promise():
    for heading in (
        "Under which conditions",
        "What is not promised",
        "What the robot's safety controller must still do",
    ):
        assert f"\n## {heading}\n" in PAGE


def test_the_places_of_other_pages_exist():
    for page, place in re.findall(r"\]\(([\w./-]+\.md)#([\w-]+)\)", PAGE):
        headings = re.findall(r"^#+ (.*)$", (ROOT / "docs" / page).resolve().read_text(encoding="utf-8"), re.MULTILINE)
        assert place in {re.sub(r"[^\w -]", "", h.lower()).replace(" ", "-") for h in headings}, (page, place)
