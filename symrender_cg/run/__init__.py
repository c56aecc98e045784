"""Run: a loaded kernel and a scene's numbers become an image. Imports no sympy; never compiles for a change of numbers."""
