"""Where the templates of the report are, and how they are filled."""

from importlib.resources import files

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined


def environment() -> Environment:
    """Return the templates; whatever they are given is escaped, and a missing value is an error."""
    return Environment(
        loader=ChoiceLoader([PackageLoader("pnpct.report", folder) for folder in ("page", "volume_page")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def text_of(name: str, folder: str = "page") -> str:
    """Return a file that stands beside the templates, or in another folder of the package."""
    return (files("pnpct.report") / folder / name).read_text(encoding="utf-8")
