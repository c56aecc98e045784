"""Laws of the binding and of loading: all entry points there, no trace left, the GIL free, usable in any process."""

from __future__ import annotations

import gc
import multiprocessing
import pickle
import threading
import time
from pathlib import Path

import pytest

from symrender_cg.build import Cache, Library, compile_library, find_toolchain, load, write_binding
from symrender_cg.errors import LibraryError

CDEF = """
typedef struct { double radius; int count; } ball;
double volume(const ball *b);
int wait_for(volatile int *flags, long long turns);
"""
SOURCES = {
    "ball.c": """\
typedef struct { double radius; int count; } ball;
double volume(const ball *b);
int wait_for(volatile int *flags, long long turns);
double volume(const ball *b) { return b->count * b->radius * b->radius * b->radius; }
int wait_for(volatile int *flags, long long turns)
{
    flags[0] = 1;
    while (turns-- > 0)
        if (flags[1]) return 1;
    return 0;
}
"""
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory.mktemp("ball"), SOURCES, CDEF)


def built(folder: Path, sources: dict[str, str], cdef: str) -> Path:
    compile_library(sources, folder / "kernel.so", toolchain=find_toolchain())
    write_binding(cdef, folder)
    return folder


def volume(library: Library, radius: float, count: int) -> float:
    return float(library.lib.volume(library.ffi.new("ball *", {"radius": radius, "count": count})))


def volume_elsewhere(library: Library, answers: multiprocessing.Queue[float]) -> None:
    answers.put(volume(library, 2.0, 3))


def test_functions_and_structs_work_after_loading(folder: Path) -> None:
    library = load(folder)
    assert volume(library, 2.0, 3) == 24.0
    assert library.path == folder / "kernel.so"


def test_a_function_outlives_everything_that_led_to_it(tmp_path: Path) -> None:
    function = load(built(tmp_path, {"n.c": "int n(void);\nint n(void) { return 7; }\n"}, "int n(void);")).lib.n
    gc.collect()
    assert function() == 7


def test_an_open_library_is_returned_as_it_is(folder: Path) -> None:
    assert load(folder) is load(folder)


def test_loading_leaves_no_file_and_no_module_behind(folder: Path) -> None:
    import sys

    files, modules = sorted(folder.rglob("*")), set(sys.modules)
    load(folder)
    assert sorted(folder.rglob("*")) == files
    assert set(sys.modules) == modules


def test_a_call_releases_the_gil(folder: Path) -> None:
    """The C function says that it runs, then waits for a flag that only another Python thread can set."""
    library = load(folder)
    flags = library.ffi.new("int[2]", [0, 0])
    seen: list[int] = []
    waiter = threading.Thread(target=lambda: seen.append(library.lib.wait_for(flags, 20_000_000_000)))
    waiter.start()
    while not flags[0]:
        time.sleep(0)
    flags[1] = 1
    waiter.join()
    assert seen == [1]
    assert library.lib.wait_for(library.ffi.new("int[2]", [0, 0]), 1000) == 0


def test_a_library_crosses_into_a_spawned_process(folder: Path) -> None:
    context = multiprocessing.get_context("spawn")
    answers = context.Queue()
    child = context.Process(target=volume_elsewhere, args=(load(folder), answers))
    child.start()
    assert answers.get(timeout=60) == 24.0
    child.join()
    assert child.exitcode == 0
    answers.close()
    answers.join_thread()


def test_a_pickled_library_is_loaded_from_the_same_place(folder: Path) -> None:
    copy = pickle.loads(pickle.dumps(load(folder)))
    assert copy.path == folder / "kernel.so"
    assert volume(copy, 1.0, 5) == 5.0


def test_a_cached_kernel_loads_as_its_folder_does(tmp_path: Path) -> None:
    kernel = Cache(tmp_path).kernel(SOURCES, CDEF)
    assert volume(load(kernel), 2.0, 3) == volume(load(kernel.folder), 2.0, 3) == 24.0


def test_libraries_with_equal_names_keep_apart(tmp_path: Path) -> None:
    libraries = []
    for number in (1, 2):
        place = tmp_path / str(number)
        place.mkdir()
        source = {"n.c": f"int n(void);\nint n(void) {{ return {number}; }}\n"}
        libraries.append(load(built(place, source, "int n(void);")))
    assert [library.lib.n() for library in libraries] == [1, 2]


def test_a_missing_entry_point_is_an_error_when_the_library_is_loaded(tmp_path: Path) -> None:
    built(tmp_path, SOURCES, CDEF + "void absent(void);")
    with pytest.raises(LibraryError, match=r"kernel\.so lacks the entry point 'absent'") as caught:
        load(tmp_path)
    assert caught.value.exit_code == 5


def test_declarations_that_cffi_cannot_read_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match="declarations of the kernel cannot be read"):
        write_binding("double f(unknown_type x);", tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_library_is_an_error_that_names_it(tmp_path: Path) -> None:
    write_binding(CDEF, tmp_path)
    with pytest.raises(LibraryError, match=r"kernel\.so cannot be loaded"):
        load(tmp_path)


def test_a_file_that_is_no_library_is_an_error_that_names_it(tmp_path: Path) -> None:
    write_binding(CDEF, tmp_path)
    (tmp_path / "kernel.so").write_text("not machine code")
    with pytest.raises(LibraryError, match=r"kernel\.so cannot be loaded"):
        load(tmp_path)


@pytest.mark.parametrize("text", ["", "ffi = ", "ffi = missing", "\0", None])
def test_a_missing_or_damaged_binding_is_an_error_that_names_it(tmp_path: Path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "binding.py").write_text(text)
    with pytest.raises(LibraryError, match=r"binding\.py cannot be read"):
        load(tmp_path)


def test_writing_a_binding_prints_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_binding(CDEF, tmp_path)
    assert capfd.readouterr() == ("", "")
