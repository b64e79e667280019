"""The program `pnpct` as `python -m pnpct`."""

import sys

from pnpct.cli import main

if __name__ == "__main__":
    sys.exit(main())
