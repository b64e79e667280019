"""How many slices are projected together."""

LANES = 32
"""Most lanes of a tile: what is computed for a strip then serves 8 slices. Larger batches are a sequence of tiles."""


def tile(slices: int, turns: int) -> tuple[int, int]:
    """Return how many lanes a tile has and how many slices it holds."""
    size = turns
    while size < min(LANES, slices * turns):
        size *= 2
    return size, size // turns
