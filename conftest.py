"""Check shapes and types of every call while tests run; numba compiles its kernels from the bare functions."""

from pathlib import Path

from jaxtyping import install_import_hook

SOURCE = Path(__file__).parent / "src"

install_import_hook(
    [
        ".".join(path.relative_to(SOURCE).with_suffix("").parts)
        for path in SOURCE.rglob("*.py")
        # Anatomy is made of thousands of small functions, each of which would be wrapped anew when it is made.
        if not path.stem.endswith("_kernels") and path.stem not in {"__init__", "vector_ir"}
        if path.parent.name != "anatomy"
    ],
    "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))",
)
