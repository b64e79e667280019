"""The pages of the documentation site: the documents of the project where they stand, and every public name.

mkdocs calls `on_files`. The site mirrors the folders of the project, so that links between documents, scripts and tests
are the same here and there.
"""

import ast
import os
import re
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "pnpct"
LINK = re.compile(r"\]\(([^)#\s]+)")
COMMAND_LINE = "docs/reference/command-line.md"


def documents() -> Iterator[Path]:
    """Yield the pages that people have written."""
    for pattern in ("*.md", "docs/**/*.md", "runs/**/*.md"):
        yield from sorted(ROOT.glob(pattern))


def notebooks() -> list[Path]:
    """Return the notebooks, which the site runs."""
    return sorted(ROOT.glob("docs/notebooks/*.ipynb"))


def linked_files() -> set[Path]:
    """Return the files of the project that documents link to: pictures, scripts, tests."""
    links = ((page.parent / link).resolve() for page in documents() for link in LINK.findall(page.read_text("utf-8")))
    return {path for path in links if path.is_file() and path.suffix != ".md"}


def reference_pages() -> dict[str, str]:
    """Return the text of a page for each module with public names: a section for each file that defines some."""
    pages = {}
    for path in [*PACKAGE.glob("[!_]*.py"), *(path.parent for path in PACKAGE.glob("*/**/__init__.py"))]:
        module = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        if found := public_names(module):
            parts = [f"# {module}", _about(module)]
            for origin, names in found.items():
                if origin != module:
                    parts += [f"## {origin.rpartition('.')[2].replace('_', ' ')}", _about(origin).partition("\n\n")[0]]
                # A function that has the name of its file hides the file, but not for what reads files.
                parts += [f"::: {origin if origin == f'{module}.{name}' else module}.{name}" for name in names]
            pages[f"docs/reference/{module.removeprefix('pnpct.')}.md"] = "\n\n".join(parts) + "\n"
    return pages


def command_line_page() -> str:
    """Return the page that has the help of every command."""
    from pnpct.cli.app import COMMANDS, main

    parts = ["# Command line"]
    for command in COMMANDS:
        with patch.dict(os.environ, COLUMNS="110", NO_COLOR="1"), redirect_stdout(StringIO()) as said:
            main([*command.split(), "--help"])
        usage, _, rest = said.getvalue().partition("\n\n")
        about, _, options = rest.partition("\n\n ")  # groups of options begin with a space
        options = re.sub(r"^ | +$", "", options, flags=re.MULTILINE).strip()
        parts += [f"## pnpct {command}", f"```text\n{usage}\n```", about, f"```text\n{options}\n```"]
    return "\n\n".join(parts) + "\n"


def public_names(module: str) -> dict[str, list[str]]:
    """Return the public names of a module, by the module that defines them."""
    source = _source(module)
    stub = source.with_suffix(".pyi")  # of a package that imports lazily
    listed, origins = None, {}
    for node in ast.parse((stub if stub.exists() else source).read_text("utf-8")).body:
        match node:
            case ast.ImportFrom(module=str(origin), names=names, level=level):
                origins |= {alias.name: f"{module}.{origin}" if level else origin for alias in names}
            case ast.Assign(targets=[ast.Name(id="__all__")], value=ast.List() as names):
                listed = ast.literal_eval(names)
            case (
                ast.FunctionDef(name=name)
                | ast.ClassDef(name=name)
                | ast.Assign(targets=[ast.Name(id=name)])
                | ast.AnnAssign(target=ast.Name(id=name))
            ):
                origins[name] = module
    if listed is None:  # all that a single file defines; nothing of a package
        own = [name for name, origin in origins.items() if origin == module and not name.startswith("_")]
        listed = [] if source.stem == "__init__" else own
    found: dict[str, list[str]] = {}
    for name, origin in origins.items():
        if name in listed:
            found.setdefault(origin, []).append(name)
    return found


def _source(module: str) -> Path:
    path = PACKAGE.parent.joinpath(*module.split("."))
    return package if (package := path / "__init__.py").exists() else path.with_suffix(".py")


def _about(module: str) -> str:
    return ast.get_docstring(ast.parse(_source(module).read_text("utf-8"))) or ""


def on_files(files: Any, *, config: Any) -> Any:
    """Give mkdocs the pages, and what they link to, in place of what it has found in its folder."""
    from mkdocs.structure.files import File, Files

    theme = [file for file in files if file.src_dir != config.docs_dir]
    style = ROOT / "docs" / "site.css"
    kept = [path.relative_to(ROOT).as_posix() for path in sorted({*documents(), *notebooks(), *linked_files(), style})]
    written = [File(path, str(ROOT), config.site_dir, config.use_directory_urls) for path in kept]
    texts = reference_pages() | {COMMAND_LINE: command_line_page()}
    made = [File.generated(config, path, content=text) for path, text in texts.items()]
    return Files([*theme, *written, *made])


on_files.mkdocs_priority = 100  # type: ignore[attr-defined]  # before what makes pages of notebooks
