"""Plan: which effects can change this image, each one left out with its proof. Touches no sympy."""
