"""What a scan covers, in words."""

from pnpct.geometry import ConeBeam, Coverage


def in_words(geometry: ConeBeam) -> dict[str, str]:
    """Return what the views of a cone beam cover, by name."""
    cover, detector = Coverage(geometry), geometry.detector
    low, high = cover.heights
    slices = cover.slices
    words = {
        "turns": f"{cover.turns:.2f}, {geometry.views / cover.turns:.0f} views a turn" if cover.turns else "none",
        "rows": f"{detector.rows} of {geometry.row_height_at_isocenter:.4g} mm at the isocentre",
        "focal spot": f"{cover.focal_spot_mode}, "
        + (f"z = {low:.2f} to {high:.2f} mm" if cover.feed else f"z = {low:.2f} mm"),
        "slices": "none has all its views" if slices is None else f"z = {slices[0]:.2f} to {slices[1]:.2f} mm",
    }
    if cover.feed:
        return {"path": f"helix, feed {cover.feed:.3f} mm a turn, pitch {cover.pitch:.3f}", **words}
    words["slices"] += " on the axis; fewer away from it, for the cone" if slices else ""
    return {"path": "axial", **words}
