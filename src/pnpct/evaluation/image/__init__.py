"""How far an image is from a reference: errors in HU, signal-to-noise ratio and similarity, by tissue."""
