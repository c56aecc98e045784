"""What --help says of each command: what it does, and examples. Nothing but text."""

DESCRIPTION = """\
A scene becomes its image as one formula, the formula readable C99, the C99 a native kernel.

Exit codes: 0 done, 2 usage or scene, 3 outside what a plan covers, 4 a stated bound broken or a certificate that cannot
be given, 5 no compiler or a failed compilation, 130 interrupted."""

EXAMPLES = """\
examples:
  python -m symrender_cg build                          Chapter 1's kernels as C under generated/, compiled
  python -m symrender_cg render -o sphere.png           its image
  python -m symrender_cg render scene.toml -o out.png --size 800x600
  python -m symrender_cg render -o sphere.png --accuracy certified --target uint8
  python -m symrender_cg explain off_axis               the plan and the derivation
  python -m symrender_cg explain mirrors --ablate       what each effect costs
  python -m symrender_cg check                          the kernels against numpy and the oracle
  python -m symrender_cg stress                         accuracy levels on hard cases
  python -m symrender_cg conditioning -o moved.png      how much half an ulp of the inputs moves each pixel
  python -m symrender_cg cost                           what accuracy costs in time, measured
  python -m symrender_cg doctor                         what this machine has and lacks
"""

BUILD = """\
Derives the image of a scene, writes its kernel as C99 under DIR, and compiles it into the cache.

    DIR/<kernel>/<kernel>.c, <kernel>.h, manifest.json     DIR/support/*.h

To compile the C yourself, add both folders to the include path. What is up to date is not touched: a second run derives
and compiles nothing. The kernel is the one for any window. A scene of many spheres has no kernel of accuracy literal,
which is the formula of one sphere, and none that is baked: its kernel loops over arrays. Of one sphere, stable and
certified have kernels that bound their own error; of many, both rest on one kernel that encloses intensities."""
BUILD_EXAMPLES = """\
examples:
  python -m symrender_cg build
  python -m symrender_cg build scene.toml --accuracy double --passes
  python -m symrender_cg build --accuracy double --bake     the scene's numbers folded into the C
  python -m symrender_cg build --accuracy certified --target uint8
  python -m symrender_cg build --max-error 1e-6             the C of the fastest variant that meets it
  python -m symrender_cg build mirrors                      the kernels of a scene of many spheres
"""

RENDER = """\
Renders a scene to an image file; its extension chooses the format.

    .png   grey, cut to [0, 1]; --bits 8 (default) or 16
           --encoding srgb (default): the transfer curve of IEC 61966-2-1, declared by an sRGB chunk in the file
           --encoding linear: grey levels proportional to intensity, declared by a gAMA chunk of 1.0
    .npy   the array of linear intensities, float64 (float32 with --accuracy fast or single)
    .npz   the same under the name `image`, with every layer that --layers names
    .pfm   linear intensities as float32, little endian, rows from bottom to top

A scene with a colour anywhere is written as RGB. --layers writes what else the kernel knows of each pixel beside the
image, out-depth.png, out-normal.png, ...:

    depth    distance from the eye; as a .png near is white, far is dark, the background black
    normal   in the camera's frame; as a .png (n + 1) / 2
    index    which sphere, then the plane; as a .png a colour each
    terms    background, ambient, diffuse and specular of each light, reflected: they add up to the image

--accuracy stable proves every value to be within 4 ulp, certified proves each to be the nearest float64, float32 or
grey level, whichever --target names; both print how many pixels each stage settled. Grey levels are written as they
are: a .png of them is 8 bit linear. Where a tie cannot be decided the pixels are named, exit code 4, and nothing is
written.

Every file is written whole or not at all."""
RENDER_EXAMPLES = """\
examples:
  python -m symrender_cg render -o sphere.png
  python -m symrender_cg render scene.toml -o out.png --size 1920x1080 --bits 16 --encoding linear
  python -m symrender_cg render off_axis -o field.npy --no-clip
  python -m symrender_cg render -o levels.png --accuracy certified --target uint8
  python -m symrender_cg render mirrors -o out.png --layers depth,normal,index,terms
  python -m symrender_cg render --list
"""

EXPLAIN = """\
Prints what a kernel rests on: the effects that are in and the proof of each one left out, every named quantity with its
formula and source, the forms that the accuracy chose, the number format of each quantity, the invariants that sympy
proved, the silhouette, and operations per stage; of stable and certified also the stages that prove a value, with the
bound of their kernel for an image of --size. Of a scene of many spheres: the plan, what the kernel loops over, and the
parts that its loops are made of.

The plan is that of an image of the shape --size; what is outside such a window is left out.

--findings EFFECT   what was found for each sphere, pair or triple, with inequality, numbers and margin
--max-error E       leave out also what changes no pixel by more than E in all; such effects are called bounded
--ablate            measure: each effect left out is forced in again (no pixel may change: exit code 4) and timed; each
                    effect kept is taken out of the scene, where it can be"""
EXPLAIN_EXAMPLES = """\
examples:
  python -m symrender_cg explain
  python -m symrender_cg explain off_axis --accuracy single
  python -m symrender_cg explain --accuracy certified --target uint8
  python -m symrender_cg explain mirrors --findings shadow
  python -m symrender_cg explain mirrors --ablate --size 512x512
  python -m symrender_cg explain --latex > derivation.tex     a document that pdflatex compiles as it is
"""

CHECK = """\
Compares each compiled kernel with the oracle (exact arithmetic and Arb balls, correctly rounded), with vectorised numpy
and with the per-pixel loop: on the pixel centres of a whole image, and on points near the silhouette, the terminator
and the highlight; of a scene of many spheres with brute force in numpy, and on points near outlines, mirrored outlines
and shadows. Errors are those of the unclipped field; certified is compared as float64. Exit code 4 when a stated bound
is broken, or another surface is seen than the oracle's."""
CHECK_EXAMPLES = """\
examples:
  python -m symrender_cg check
  python -m symrender_cg check far --accuracy literal,double --points 5000
  python -m symrender_cg check --json > check.json
"""

STRESS = """\
Measures accuracy levels on families of hard cases, each drawn from a seed and compared with the oracle: outlines to the
last float, eyes and lights on the surface or 1e300 away, exponents to 1e300, edges of shadows, mirrors and tiles. With
SCENE that scene's own hard points: outlines, terminators, highlights, edges. Errors are those of the unclipped field.

Exit code 4 when a level breaks what it states; the statements, family and case are printed below the table."""
STRESS_EXAMPLES = """\
examples:
  python -m symrender_cg stress
  python -m symrender_cg stress --family terminator --family rdv0 --level double --count 2000
  python -m symrender_cg stress mirrors --level double
  python -m symrender_cg stress --seed 7 --keep worst.json
  python -m symrender_cg stress --atlas atlas.png
"""

CONDITIONING = """\
How much half an ulp of every input (each number of the scene in the camera's frame, and the point) moves each pixel,
in first order: what no kernel can be blamed for. A pixel flips where such a move takes a decision over its border: an
outline, the edge of a shadow or a tile, the nearer of two surfaces. Prints one line of figures of the pixels that show
a surface; with -o also draws a picture, colours on a log scale, flips marked."""
CONDITIONING_EXAMPLES = """\
examples:
  python -m symrender_cg conditioning
  python -m symrender_cg conditioning mirrors -o moved.png --size 320x180
  python -m symrender_cg conditioning far_small --json
"""

COST = """\
Measures what accuracy costs in time: every level, choices beside the levels that a search finds, kernels with the
scene's numbers baked in, plans that leave out more or less, numpy, sympy's lambdify, four rays a pixel. Times are
interleaved in one run on one thread; errors are those of the unclipped field against the oracle, at points that the
search did not use. Printed are the front (nothing is both faster and more accurate), what each step along it buys, what
dominates the rest, and when a special kernel has paid for its build. Kept by scene and machine.

--max-error, --max-ulp, --bits   which variant render_image would draw with, and which it looked at (after a run of
                                 cost: all that it found); --bake: baked ones too; exit code 4 where none meets it"""
COST_EXAMPLES = """\
examples:
  python -m symrender_cg cost
  python -m symrender_cg cost mirrors --plot cost.png --html cost.html
  python -m symrender_cg cost hundred --quick --effects
  python -m symrender_cg cost --max-error 1e-6
"""

DOCTOR = """\
Says what this machine has: compiler, flags and target as resolved, the vector width in the kernels' inner loops (from
the compiler's own report), the cache, Python packages; and how to get what is missing. Exit code 5 without a compiler
that works."""
DOCTOR_EXAMPLES = """\
examples:
  python -m symrender_cg doctor
  python -m symrender_cg doctor --vectors generated/centred_sphere_double/centred_sphere_double.c
  python -m symrender_cg doctor --clear-cache
"""
