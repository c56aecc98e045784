"""Derive: from a plan to an `ImageProgram`, the mathematics of the image as an ordered list of named definitions.

In comes a plan, out goes exact mathematics over sympy symbols; floating point is never thought of here.
"""
