"""Where the pixels, the focal spot and the detector cells are. Millimetres and radians; no torch needed."""

from pnpct.geometry.fan_beam import FanBeam, evenly_spaced_views
from pnpct.geometry.image_grid import ImageGrid

__all__ = ["FanBeam", "ImageGrid", "evenly_spaced_views"]
