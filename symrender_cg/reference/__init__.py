"""What the compiled kernels are compared with: float references that need no compiler, and an oracle that is proved.

    per_pixel     the seed's Cell 1, a python loop                     a reference
    vectorised    the seed's Cell 4, and the stable forms by numpy     a reference, and the backend without a compiler
        stable_view, stable_tiles, stable_shading, pairs               the stable forms: a frame, points, light, hi + lo
    points        a caller's points, and pixel centres
    hard_places   points where an image is hard to get right

    camera_numbers, decisions    one sphere and one light in the camera's frame; exactly, whether a ray hits and is lit

    brute_force   every ray, sphere, blocker and bounce by numpy, no plan       a reference for all scenes
    oracle        exact numbers and Arb balls, correctly rounded                the truth for all scenes
    compare       largest errors of float values against the oracle's answers
    check, check_scene    the kernels against all of these; they stand above the pipeline

Those before `brute_force` take a Scene with one sphere and one light. All move it to the camera's frame and take those
numbers as exact.
Import the module that you need: only `oracle` and `compare` load python-flint, and `hard_places` when it searches.
"""
