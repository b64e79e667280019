"""Plug-and-play reconstruction for low-dose CT.

The package is layered; each line imports only lines below it:

    cli              one file per command
    report           results -> one page
    comparison       methods side by side
    training         scans -> weights of a denoiser
    reconstruction   sinogram -> image           evaluation   images -> numbers
    simulation       anatomy -> scan
    files            numbers <-> disk
    denoisers        image -> image              physics      scan -> log and weights
    operators        projectors, ramp filter, processes
    geometry         grids, fan and cone beams, lesions
    units, arrays
"""

from importlib.metadata import version

__version__ = version("pnpct")
