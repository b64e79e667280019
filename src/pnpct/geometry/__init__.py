"""Where the pixels, the focal spot, the detector cells and lesions are. Millimetres and radians; no torch needed."""

from pnpct.geometry.cone_beam import DEFAULT_SIZE, ConeBeam
from pnpct.geometry.coverage import Coverage
from pnpct.geometry.detector import Detector
from pnpct.geometry.fan_beam import FanBeam, Geometry, require_fan_beam
from pnpct.geometry.image_grid import ImageGrid
from pnpct.geometry.lesions import Insert, Lesion, disc_mask, lesion_mask
from pnpct.geometry.plane_stack import Plane, PlaneStack
from pnpct.geometry.rays_inside import rays_inside, slices_beyond, views_meeting
from pnpct.geometry.tilted_planes import Rebinning, TiltedPlanes
from pnpct.geometry.trajectory import Trajectory, Views, evenly_spaced_views, view_numbers
from pnpct.geometry.volume_grid import Grid, VolumeGrid, require_image_grid

__all__ = [
    "DEFAULT_SIZE",
    "ConeBeam",
    "Coverage",
    "Detector",
    "FanBeam",
    "Geometry",
    "Grid",
    "ImageGrid",
    "Insert",
    "Lesion",
    "Plane",
    "PlaneStack",
    "Rebinning",
    "TiltedPlanes",
    "Trajectory",
    "Views",
    "VolumeGrid",
    "disc_mask",
    "evenly_spaced_views",
    "lesion_mask",
    "rays_inside",
    "require_fan_beam",
    "require_image_grid",
    "slices_beyond",
    "view_numbers",
    "views_meeting",
]
