"""Run: a loaded kernel and a scene's numbers become an image. No sympy; no compile for a change of numbers."""
