"""The built site has every public name, and the pages tell the truth about the source. Run by `make docs`."""

import importlib
import posixpath
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from sphinx.util.inventory import InventoryFile

ROOT = Path(__file__).parents[2]
SITE = ROOT / "build/docs/html"
HEADERS = ROOT / "cpp/include/sigmaik"
MODULES = [
    "",
    ".indices",
    ".methods",
    ".models",
    ".planning",
    ".planning.costs",
    ".robots",
    ".ros2",
    ".sim",
    ".singularities",
    ".teleop",
]


@pytest.fixture(scope="module")
def entries() -> dict[str, set[str]]:
    """Names that the site has an entry of, by domain."""
    with (SITE / "objects.inv").open("rb") as file:
        inventory = InventoryFile.load(file, "", posixpath.join)
    found: dict[str, set[str]] = {}
    for kind, names in inventory.items():
        found.setdefault(kind.split(":")[0], set()).update(names)
    return found


@pytest.mark.parametrize("module", ["sigmaik" + m for m in MODULES])
def test_every_public_name_of_python_has_an_entry(module, entries):
    public = importlib.import_module(module)
    modules = {"sigmaik" + m for m in MODULES}
    names = {f"{module}.{name}" for name in public.__all__} - modules - {"sigmaik.__version__"} - entries["py"]
    for other in (importlib.import_module(m) for m in modules):  # an object of several modules needs one entry
        same = {name for name in other.__all__ if getattr(public, name, None) is getattr(other, name)}
        names -= {f"{module}.{name}" for name in same if f"{other.__name__}.{name}" in entries["py"]}
    assert names == set()


def test_every_public_class_of_a_header_has_an_entry(entries):
    text = "\n".join(header.read_text(encoding="utf-8") for header in HEADERS.rglob("*.hpp"))
    text = re.sub(r"^namespace sigmaik::detail \{.*?^\}  // namespace", "", text, flags=re.MULTILINE | re.DOTALL)
    names = set(re.findall(r"^(?:class|struct|enum class) (\w+)[^;<]*{$", text, re.MULTILINE))
    assert len(names) > 50
    known = {name.rpartition("::")[2] for name in entries["cpp"]}
    assert names - known == set()


def test_the_search_index_knows_the_pages():
    index = (SITE / "searchindex.js").read_text(encoding="utf-8")
    for page in (
        "docs/getting-started",
        "docs/glossary",
        "docs/api/python/servo",
        "docs/api/cpp/servo",
        "CONTRIBUTING",
    ):
        assert f'"{page}"' in index


def statements() -> Iterator[tuple[str, str]]:
    """(file, name) for every "`file`: … `name` …" of docs/architecture.md."""
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    for item in re.split(r"\n(?=\d\. |- |\n|\|)", text):
        file = None
        for word in re.findall(r"`([^`]+)`", item):
            if "/" in word and "NAME" not in word:
                file = word
                yield file, ""
            elif file and re.fullmatch(r"[A-Za-z_][\w:]*", word):
                yield file, word


def test_architecture_names_files_and_functions_that_exist():
    found = list(statements())
    assert len({file for file, _ in found}) > 20
    for file, name in found:
        path = ROOT / file
        assert path.exists(), file
        if name and path.is_file():
            text = path.read_text(encoding="utf-8")
            assert re.search(rf"\b{name.rpartition('::')[2]}\b", text), f"{name} is not in {file}"


def test_the_program_of_getting_started_is_an_example():
    page = (ROOT / "docs/getting-started.md").read_text(encoding="utf-8")
    programs = re.findall(r"^```cpp\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    examples = {example.read_text(encoding="utf-8") for example in (ROOT / "cpp/examples").glob("*.cpp")}
    assert programs
    assert set(programs) <= examples  # which ctest compiles and runs


def test_version_changelog_and_citation_agree():
    def read(name: str) -> str:
        return (ROOT / name).read_text(encoding="utf-8")

    versions = re.findall(r"^## \[([\d.]+)\] - (\S+)$", read("CHANGELOG.md"), re.MULTILINE)
    assert re.search(r"^project\(sigmaik VERSION (\S+)", read("CMakeLists.txt"), re.MULTILINE)[1] == versions[0][0]
    released = next((version, date) for version, date in versions if date != "unreleased")
    cited = re.search(r'^version: (\S+)\ndate-released: "(\S+)"$', read("CITATION.cff"), re.MULTILINE)
    assert cited.groups() == released
