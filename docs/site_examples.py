"""For the documentation site: a section "Example:" of a docstring is shown as code, as griffe shows "Examples:"."""

from typing import Any

from griffe import Extension, Object


class SingleExample(Extension):
    """Read the singular as the plural."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Change the title, before the docstring is parsed."""
        if obj.docstring:
            obj.docstring.value = obj.docstring.value.replace("\nExample:\n", "\nExamples:\n")
