"""Imports go one way, in the order of the pipeline; what is heavy is loaded only by those who need it."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import symrender_cg

PACKAGE = Path(symrender_cg.__file__).resolve().parent
ROOT = PACKAGE.parent

# Who may import whom: a part of the package -> the parts below it. `pipeline` drives the stages, `run.render` and the
# command line stand above it.
BELOW: dict[str, set[str]] = {
    "version": set(),
    "errors": set(),
    "resources": {"errors"},
    "scene": {"errors", "version", "resources"},
    "plan": {"errors", "scene"},
    "derive": {"errors", "plan"},
    "lower": {"errors", "plan", "derive"},
    "emit": {"errors", "version", "resources", "plan", "derive", "lower"},
    "build": {"errors", "version", "resources"},
    "reference": {"errors", "scene"},
}
ABOVE = {PACKAGE / "reference" / "check.py", PACKAGE / "reference" / "check_scene.py"}
"""These stand above the pipeline: they compare what the pipeline makes with the references beside them."""

NO_SYMPY = ("version", "errors", "resources", "scene", "plan", "build", "run", "reference")


def modules(part: str) -> list[Path]:
    folder = PACKAGE / part
    return sorted(set(folder.rglob("*.py")) - ABOVE) if folder.is_dir() else [PACKAGE / f"{part}.py"]


def imported(path: Path) -> set[str]:
    """Dotted names of everything that a module imports, wherever in it, also inside functions."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import hides where it leads"
            assert node.module is not None
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def parts_used(path: Path) -> set[str]:
    """The parts of this package that a module imports."""
    prefix = "symrender_cg."
    found = {name.removeprefix(prefix).split(".")[0] for name in imported(path) if name.startswith(prefix)}
    return {part for part in found if (PACKAGE / part).is_dir() or (PACKAGE / f"{part}.py").is_file()}


@pytest.mark.parametrize("part", BELOW)
def test_imports_go_one_way_in_the_order_of_the_pipeline(part: str) -> None:
    assert modules(part)
    for path in modules(part):
        above = parts_used(path) - BELOW[part] - {part}
        assert not above, f"{path.relative_to(ROOT)} imports {sorted(above)}"


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_module_imports_a_private_name_of_another(path: Path) -> None:
    names = {name for name in imported(path) if name.startswith("symrender_cg.")}
    assert not {name for name in names if any(word.startswith("_") for word in name.split("."))}


@pytest.mark.parametrize("part", NO_SYMPY)
def test_the_parts_that_run_without_sympy_do_not_name_it(part: str) -> None:
    for path in modules(part):
        heavy = {name for name in imported(path) if name.split(".")[0] == "sympy"}
        assert not heavy, f"{path.relative_to(ROOT)} imports {sorted(heavy)}"


def test_no_module_of_the_stages_is_imported_by_a_cycle() -> None:
    """Module by module, not part by part: the graph of imports at the top level has no cycle."""
    paths = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in PACKAGE.rglob("*.py")}
    graph: dict[str, set[str]] = {}
    for name, path in paths.items():
        used: set[str] = set()
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                members = {f"{node.module}.{alias.name}" for alias in node.names}
                used |= members & paths.keys() or {node.module, f"{node.module}.__init__"} & paths.keys()
        graph[name] = used
    done: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, " -> ".join((*trail, name))
        if name not in done:
            for used in sorted(graph.get(name, set())):
                visit(used, (*trail, name))
            done.add(name)

    for name in sorted(graph):
        visit(name, ())


def modules_after(code: str, *arguments: str) -> set[str]:
    """Names of the modules that a fresh interpreter holds after running `code`."""
    program = (
        f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{code}\nimport json; print(json.dumps(sorted(sys.modules)))"
    )
    command = [sys.executable, "-W", "error", "-c", program, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


RENDER = (
    "from symrender_cg import Scene, evaluate, render_image, statistics\n"
    "import sys\n"
    "image = render_image(Scene.chapter1(shininess=7.5), 8, 6, cache=sys.argv[1])\n"
    "value = evaluate(None, 0.0, 0.0, cache=sys.argv[1])\n"
    "assert (statistics.derived, statistics.compiled) == (int(sys.argv[2]), int(sys.argv[2])), statistics\n"
)


def test_a_cached_kernel_is_loaded_without_sympy_jinja_or_a_compiler(tmp_path: Path) -> None:
    cold = modules_after(RENDER, str(tmp_path), "1")
    warm = modules_after(RENDER + "import subprocess\n", str(tmp_path), "0")
    assert {"sympy", "jinja2"} <= cold
    assert not {"sympy", "jinja2", "mpmath", "flint", "matplotlib", "PIL", "rich"} & warm


def test_importing_the_package_loads_nothing_heavy() -> None:
    loaded = modules_after("import symrender_cg")
    assert not {"sympy", "numpy", "jinja2", "cffi", "msgspec", "flint"} & loaded


def test_a_scene_can_be_made_and_planned_without_numpy_or_sympy() -> None:
    loaded = modules_after(
        "from symrender_cg.scene import Scene; from symrender_cg.plan.plan import plan; plan(Scene.chapter1())"
    )
    assert not {"sympy", "numpy", "jinja2", "cffi"} & loaded


def test_all_names_every_public_name_and_only_those() -> None:
    assert symrender_cg.__all__ == sorted(symrender_cg.__all__, key=str)
    for name in symrender_cg.__all__:
        assert getattr(symrender_cg, name) is not None
    assert set(symrender_cg.__all__) <= set(dir(symrender_cg))
    assert set(symrender_cg._HOME) | {"__version__"} == set(symrender_cg.__all__)


def test_every_public_name_is_what_its_home_defines() -> None:
    """In a fresh interpreter, one name at a time: a subpackage of the same name must not come instead."""
    for name, home in sorted(symrender_cg._HOME.items()):
        code = (
            f"from symrender_cg import {name} as given\n"
            f"from importlib import import_module\n"
            f"assert given is getattr(import_module('symrender_cg.{home}'), {name!r}), given\n"
        )
        if home not in ("errors", "scene"):
            modules_after(code)


def test_a_name_that_the_package_does_not_have_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'symrender_cg' has no attribute 'render'"):
        symrender_cg.render  # noqa: B018


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("__init__.py")), ids=lambda path: path.parent.name)
def test_every_all_lists_names_that_exist(path: Path) -> None:
    name = ".".join(path.relative_to(ROOT).parent.parts)
    module = __import__(name, fromlist=["*"])
    for entry in getattr(module, "__all__", ()):
        assert hasattr(module, entry), f"{name}.{entry}"


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_every_module_opens_with_what_it_is_for(path: Path) -> None:
    assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), path
