"""The Python blocks of the pages that a new user reads first run as they stand, in order, in one session."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    page
    for page in (
        "README.md",
        "docs/getting-started.md",
        "docs/position_ik.md",
        "docs/batches.md",
        "docs/action_chunks.md",
        "docs/learning.md",
    )
    if (ROOT / page).exists()
]


def blocks(page: str) -> list[tuple[int, str]]:
    """Number of the first line, and text, of every Python block."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [(text.count("\n", 0, block.start(1)), block[1]) for block in found]


@pytest.mark.parametrize("page", PAGES)
def test_the_python_blocks_run_as_they_stand(page, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    session: dict[str, object] = {"__name__": "__main__"}
    assert blocks(page)
    for line, block in blocks(page):
        exec(compile("\n" * line + block, page, "exec"), session)
    printed = capsys.readouterr().out
    assert "0x" not in printed  # no address of an object
