"""The documentation site, built by `make docs`: the pages, the Python API and the C++ API."""

from __future__ import annotations

import logging
import re
from pathlib import Path

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

import sigmaik

project = "sigmaik"
author = copyright = "The sigmaik authors"
version = release = sigmaik.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "breathe"]

# The source directory is the repository's root, so that every link between README.md and docs/ means the same file here
# and on a Git forge.
root_doc = "docs/index"
include_patterns = ["*.md", "docs/**"]
exclude_patterns = [".*", "bench", "bindings", "build", "cpp", "dist", "docs/Doxyfile", "python", "tests", "tools"]
html_additional_pages = {"index": "redirect.html"}
templates_path = ["templates"]

myst_heading_anchors = 4

autodoc_default_options = {"members": True, "undoc-members": True}
autodoc_member_order = "groupwise"
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Avoid", "Solver", "Index")}
autoclass_content = "both"
napoleon_google_docstring = False
python_maximum_signature_line_length = 100
python_use_unqualified_type_names = True

ROOT = Path(__file__).parents[1]
breathe_projects = {"sigmaik": str(ROOT / "build/docs/doxygen/xml")}
breathe_default_project = "sigmaik"
breathe_show_include = False
cpp_maximum_signature_line_length = 100

html_theme = "furo"
html_title = f"sigmaik {version}"
html_show_sourcelink = False
html_copy_source = False


def _text(app, what, name, obj, options, lines: list[str]) -> None:
    """Make reStructuredText of a docstring: code, items `name: …`, and characters that mean what they are."""
    begin = next((i for i, line in enumerate(lines) if re.fullmatch(r"\s*-{3,}", line)), None)
    text = lines if begin is None else lines[: begin - 1]  # from there on it is numpydoc's, which napoleon knows
    kept: list[str] = []
    for block in re.split(r"\n\s*\n", "\n".join(text).strip("\n")):
        rows = block.split("\n")
        if all(row.startswith("    ") for row in rows):
            kept += ["::", "", *rows, ""]
            continue
        items: list[str] = []
        for row in rows:
            if items and not re.match(r"[\w, ]+(\[[^\]]*\])?:", row):
                items[-1] += " " + row.strip()
            else:
                items.append(row)
        kept += ["| " + _escaped(item) for item in items] + [""]
    lines[:] = kept + ([] if begin is None else [_escaped(line) for line in lines[begin - 1 :]])


def _escaped(line: str) -> str:
    """With |, * and _ as they are, outside of `code`."""
    return re.sub(r"(`+[^`]*`+)|([\\*|]|_\b)", lambda found: found[1] or "\\" + found[2], line)


def _signature(app, what, name, obj, options, signature: str | None, returned: str | None):
    """What a reader calls the types by; pybind11 and autodoc have longer names."""
    if signature:
        signature = re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", signature)
        signature = re.sub(r"typing\.SupportsFloat \| typing\.SupportsIndex", "float", signature)
        signature = re.sub(r"typing\.SupportsInt \| typing\.SupportsIndex", "int", signature)
        signature = re.sub(r"\(self: [\w.]+(, )?", "(", signature)
        signature = signature.replace("numpy.typing.", "")
    return signature, returned


def _says_more(record: logging.LogRecord) -> bool:
    """False for the duplicates that are none: a namespace, which every header opens again."""
    return not re.search(
        r"Duplicate C\+\+ declaration.*cpp:type:: (sigmaik|planning|costs)'", record.getMessage(), re.DOTALL
    )


for _logger in ("sphinx.sphinx.domains.cpp", "sphinx.sphinx.domains.cpp._symbol"):
    logging.getLogger(_logger).addFilter(_says_more)


class Headers(SphinxDirective):
    """A section with the comments of each header that matches: `.. headers:: servo.hpp planning/*.hpp`."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        folder = ROOT / "cpp/include/sigmaik"
        found = [file for pattern in self.arguments[0].split() for file in sorted(folder.glob(pattern))]
        text = "".join(f"{f.name}\n{'-' * len(f.name)}\n\n.. doxygenfile:: {f.name}\n\n" for f in found)
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def setup(app) -> None:
    app.add_directive("headers", Headers)
    app.connect("autodoc-process-docstring", _text, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", _signature)
