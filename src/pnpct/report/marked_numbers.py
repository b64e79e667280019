"""The numbers of a page: each is looked up in `metrics.json` by the path that the page names beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from pnpct.report.words import spell, spell_exactly

NOT_A_NUMBER = Markup('<span class="none" title="it does not exist: infinite or undefined">n/a</span>')
NOT_MEASURED = Markup('<span class="none" title="not measured">–</span>')


def pointer(*keys: str | int) -> str:
    """Return the JSON pointer (RFC 6901) to a value.

    Example:
        >>> pointer("fidelity", "chest", "fbp", "rmse_hu"), pointer("a/b", 0)
        ('/fidelity/chest/fbp/rmse_hu', '/a~1b/0')
    """
    return "".join("/" + str(key).replace("~", "~0").replace("/", "~1") for key in keys)


@dataclass(frozen=True)
class Numbers:
    """What `metrics.json` holds, as plain values, and how a page shows a number of it.

    Args:
        content: The content of the file.
    """

    content: Mapping[str, Any]

    def find(self, *keys: str | int) -> Any:
        """Return what is at the end of a path, None if there is nothing."""
        found: Any = self.content
        for key in keys:
            if isinstance(found, Mapping):
                found = found.get(str(key))
            elif isinstance(found, Sequence) and isinstance(key, int) and key < len(found):
                found = found[key]
            else:
                return None
        return found

    def attributes(self, *keys: str | int, scale: float = 1.0) -> Markup:
        """Return the attributes by which a page says whence a number is, and what it is multiplied by."""
        scaled = f' data-scale="{scale:g}"' if scale != 1.0 else ""
        return Markup(f'data-path="{{}}"{scaled}').format(pointer(*keys))

    def text(self, *keys: str | int, scale: float = 1.0, digits: int = 3, signed: bool = False) -> str:
        """Return a number as it is spelled, or n/a."""
        value = self.find(*keys)
        return "n/a" if value is None else spell(scale * value, digits=digits, signed=signed)

    def __call__(
        self,
        *keys: str | int,
        scale: float = 1.0,
        digits: int = 3,
        decimals: int | None = None,
        signed: bool = False,
    ) -> Markup:
        """Return a number as an element of a page that names its path; n/a or a dash where there is none."""
        *parents, last = keys
        parent = self.find(*parents)
        if parent is None or (isinstance(parent, Mapping) and last not in parent):
            return NOT_MEASURED
        value = self.find(*keys)
        if value is None:
            return NOT_A_NUMBER
        said = Markup('<data value="{}" {}>{}</data>')
        where = self.attributes(*keys, scale=scale)
        words = spell(scale * value, digits=digits, decimals=decimals, signed=signed)
        return said.format(value, where, words)

    def exact(self, *keys: str | int) -> Markup:
        """Return any plain value as an element of a page that names its path: numbers with all their digits."""
        value = self.find(*keys)
        if value is None:
            return NOT_MEASURED
        if isinstance(value, int | float) and not isinstance(value, bool):
            said = Markup('<data value="{}" {}>{}</data>')
            return said.format(value, self.attributes(*keys), spell_exactly(value))
        words = ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
        return Markup("<span {}>{}</span>").format(self.attributes(*keys), words)
