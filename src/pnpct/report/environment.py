"""Where the templates of the report are, and how they are filled."""

from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined


def environment() -> Environment:
    """Return the templates; whatever they are given is escaped, and a missing value is an error."""
    return Environment(
        loader=PackageLoader("pnpct.report", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def text_of(name: str) -> str:
    """Return a file that stands beside the templates."""
    return (files("pnpct.report") / "page" / name).read_text(encoding="utf-8")
