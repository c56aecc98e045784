"""Hard scenes and points, found exactly: what breaks an image's formula, measured level by level."""
