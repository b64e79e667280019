"""Make all pictures of the gallery, in 48 colours: python docs/gallery/build.py."""

import runpy
from pathlib import Path

from PIL import Image as Picture


def shrink(path: Path) -> None:
    """Write a picture in few colours, a third of its size."""
    with Picture.open(path) as picture:
        few = picture.convert("RGB").quantize(48, dither=Picture.Dither.NONE)
    few.save(path, optimize=True)


def main() -> None:
    """Run the scripts, one after the other."""
    for script in sorted(Path(__file__).parent.glob("*.py")):
        if script.name != Path(__file__).name:
            print(script.stem)
            runpy.run_path(str(script))
            shrink(script.with_suffix(".png"))


if __name__ == "__main__":
    main()
