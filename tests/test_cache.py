"""Laws of the cache: one build a key, whole entries or none, no failure outlives its call, no process when warm."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from symrender_cg.build import Cache, CachedKernel, CacheSize, CacheWarning, default_root
from symrender_cg.build import cache as cache_module
from symrender_cg.build import library as library_module
from symrender_cg.errors import ArgumentError, CompileError, CompilerNotFoundError, LibraryError

ROOT = Path(__file__).resolve().parents[1]
GCC = shutil.which("gcc") or "gcc"
CDEF = "double add(double a, double b);"
ADD = {
    "add.c": '#include "add.h"\ndouble add(double a, double b) { return a + b; }\n',
    "add.h": "double add(double a, double b);\n",
}
BAD = {"add.c": "double add(double a, double b) { return a + undeclared; }\n"}
# What another process does: build or find the kernel, call it, say where it came from.
CLIENT = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
from symrender_cg.build import Cache
cache = Cache(sys.argv[1])
kernel = cache.kernel({ADD!r}, {CDEF!r})
print(cache.load(kernel).lib.add(1.0, 2.0), kernel.from_cache, kernel.folder)
"""


@pytest.fixture(autouse=True)
def _fresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No CC and no substitute folder from another test."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(cache_module, "_substitutes", {})
    yield
    for folder in cache_module._substitutes.values():
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    return Cache(tmp_path / "cache")


def compiler_script(path: Path, on_compile: str) -> Path:
    """A compiler that does something before each compilation of a library; questions go straight to gcc."""
    path.write_text(f'#!/bin/sh\ncase "$*" in *-shared*) {on_compile} ;; esac\nexec {GCC} "$@"\n')
    path.chmod(0o755)
    return path


def added(cache: Cache, kernel: CachedKernel) -> float:
    return float(cache.load(kernel).lib.add(1.0, 2.0))


def entries(cache: Cache) -> list[str]:
    folder = cache.root / "kernels"
    return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []


def no_process(*args: object, **kwargs: object) -> None:
    raise AssertionError(f"a process was started: {args}")


def test_a_kernel_is_built_once_and_then_found(cache: Cache) -> None:
    first = cache.kernel(ADD, CDEF)
    second = Cache(cache.root).kernel(ADD, CDEF)
    assert not first.from_cache
    assert first.compile_seconds > 0.0
    assert second.from_cache
    assert second.compile_seconds == 0.0
    assert first.folder == second.folder
    assert first.manifest == second.manifest
    assert added(cache, first) == added(cache, second) == 3.0
    assert entries(cache) == [first.manifest.key]


def test_the_folder_holds_sources_library_binding_and_a_manifest_that_lists_them(cache: Cache) -> None:
    kernel = cache.kernel(ADD, CDEF)
    listed = {entry.name: entry.bytes for entry in kernel.manifest.files}
    present = {path.name: path.stat().st_size for path in kernel.folder.iterdir()}
    assert present.pop("manifest.json") > 0
    assert listed == present
    assert set(listed) == {"add.c", "add.h", "kernel.so", "binding.py", "kernel.cdef"}
    assert (kernel.folder / "add.c").read_text() == ADD["add.c"]
    assert kernel.library_path == kernel.folder / "kernel.so"
    assert "add.c" in kernel.manifest.command
    assert kernel.manifest.seconds == kernel.compile_seconds


def test_each_thing_that_decides_the_library_changes_the_key(cache: Cache, monkeypatch: pytest.MonkeyPatch) -> None:
    here = cache.toolchain()
    other_native = replace(here.native, fingerprint="another machine")
    kernels = [
        cache.kernel(ADD, CDEF),
        cache.kernel({**ADD, "add.h": ADD["add.h"] + "\n"}, CDEF),
        cache.kernel({"plus.c": ADD["add.c"], "add.h": ADD["add.h"]}, CDEF),
        cache.kernel(ADD, CDEF + " "),
        cache.kernel(ADD, CDEF, portable=True),
        cache.kernel(ADD, CDEF, extra_flags=("-O2",)),
        cache.kernel(ADD, CDEF, toolchain=replace(here, version="gcc version 99")),
        cache.kernel(ADD, CDEF, toolchain=replace(here, path="/elsewhere/cc")),
        cache.kernel(ADD, CDEF, toolchain=replace(here, native=other_native)),
    ]
    monkeypatch.setattr(library_module, "cffi_version", lambda: "99.0")
    kernels.append(cache.kernel(ADD, CDEF))
    assert len({kernel.manifest.key for kernel in kernels}) == len(kernels)
    assert not any(kernel.from_cache for kernel in kernels)


def test_a_library_from_another_machine_is_not_picked_up(cache: Cache) -> None:
    here = cache.toolchain()
    there = replace(here, native=replace(here.native, fingerprint="a processor with more instructions"))
    foreign = cache.kernel(ADD, CDEF, toolchain=there)
    cache.remember("scene", foreign, None)
    own = cache.kernel(ADD, CDEF)
    assert not own.from_cache
    assert own.folder != foreign.folder
    assert cache.recall("scene") is None


def test_eight_threads_racing_on_first_use_share_one_compile(
    tmp_path: Path, cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "log"
    monkeypatch.setenv("CC", str(compiler_script(tmp_path / "cc", f"echo compiled >> {log}; sleep 0.2")))
    cache.toolchain()
    start = threading.Barrier(8)
    sums: list[float] = []
    kernels: list[CachedKernel] = []

    def use() -> None:
        start.wait()
        kernel = Cache(cache.root).kernel(ADD, CDEF)
        kernels.append(kernel)
        sums.append(added(cache, kernel))

    threads = [threading.Thread(target=use) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sums == [3.0] * 8
    assert log.read_text().splitlines() == ["compiled"]
    assert [kernel.from_cache for kernel in kernels].count(False) == 1
    assert entries(cache) == [kernels[0].manifest.key]


def test_two_processes_racing_on_first_use_publish_one_library_and_both_work(
    tmp_path: Path, cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    # each compilation waits until the other one has begun, so both are under way at once
    meet = f"touch {tmp_path}/began-$$; for i in $(seq 100); do [ $(ls {tmp_path} | grep -c began-) -ge 2 ] && break"
    monkeypatch.setenv("CC", str(compiler_script(tmp_path / "cc", f"{meet}; sleep 0.05; done")))
    cache.toolchain()
    command = [sys.executable, "-W", "error", "-c", CLIENT, str(cache.root)]
    clients = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = [client.communicate()[0].split() for client in clients]
    assert [client.returncode for client in clients] == [0, 0]
    assert len(list(tmp_path.glob("began-*"))) == 2
    assert [words[0] for words in said] == ["3.0", "3.0"]
    assert sorted(words[1] for words in said) == ["False", "True"]
    assert said[0][2] == said[1][2]
    assert entries(cache) == [Path(said[0][2]).name]


def test_a_build_killed_half_way_leaves_nothing_that_the_next_run_trips_over(
    tmp_path: Path, cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = compiler_script(tmp_path / "slow-cc", f"touch {tmp_path}/began; sleep 60")
    environment = {**os.environ, "CC": str(slow)}
    command = [sys.executable, "-c", CLIENT, str(cache.root)]
    with subprocess.Popen(command, env=environment, start_new_session=True) as victim:
        while not (tmp_path / "began").exists():
            assert victim.poll() is None
            time.sleep(0.01)
        os.killpg(victim.pid, signal.SIGKILL)
        assert victim.wait() == -signal.SIGKILL
    (left,) = entries(cache)
    assert left.startswith(".building-")
    assert cache.size().kernels == 0
    monkeypatch.setenv("CC", str(compiler_script(slow, ":")))
    kernel = cache.kernel(ADD, CDEF)
    assert not kernel.from_cache
    assert added(cache, kernel) == 3.0
    assert entries(cache) == [left, kernel.manifest.key]  # it might still be at work: an hour is left to it
    os.utime(cache.root / "kernels" / left, (0, 0))
    other = cache.kernel(ADD, CDEF, portable=True)
    assert entries(cache) == sorted([kernel.manifest.key, other.manifest.key])


@pytest.mark.parametrize("name", ["kernel.so", "binding.py", "manifest.json"])
@pytest.mark.parametrize("kept", [0.0, 0.5, None])
def test_a_truncated_or_missing_file_is_rebuilt(cache: Cache, name: str, kept: float | None) -> None:
    first = cache.kernel(ADD, CDEF)
    cache.remember("scene", first, None)
    path = first.folder / name
    content = path.read_bytes()
    path.unlink()
    if kept is not None:
        path.write_bytes(content[: int(kept * len(content))])
    assert cache.recall("scene") is None
    second = cache.kernel(ADD, CDEF)
    assert not second.from_cache
    assert added(cache, second) == 3.0
    assert entries(cache) == [first.manifest.key]
    assert cache.recall("scene") is not None


@pytest.mark.parametrize("name", ["kernel.so", "binding.py"])
def test_damage_that_keeps_the_size_is_found_and_healed_when_the_library_is_loaded(cache: Cache, name: str) -> None:
    kernel = cache.kernel(ADD, CDEF)
    path = kernel.folder / name
    path.write_bytes(bytes(path.stat().st_size))
    found = cache.kernel(ADD, CDEF)
    assert found.from_cache
    assert added(cache, found) == 3.0
    assert path.read_bytes().strip(b"\0")


def test_damage_to_the_sources_too_is_an_error_once_and_then_rebuilt(cache: Cache) -> None:
    kernel = cache.kernel(ADD, CDEF)
    for path in (kernel.library_path, kernel.folder / "add.c"):
        path.write_bytes(bytes(path.stat().st_size))
    with pytest.raises(LibraryError, match="damaged and is removed; run the same command again"):
        cache.load(kernel)
    assert entries(cache) == []
    assert added(cache, cache.kernel(ADD, CDEF)) == 3.0


def test_a_library_that_is_whole_and_still_does_not_load_is_not_rebuilt_in_vain(cache: Cache) -> None:
    kernel = cache.kernel(ADD, CDEF + " int absent(void);")
    with pytest.raises(LibraryError, match="lacks the entry point 'absent'"):
        cache.load(kernel)
    assert entries(cache) == [kernel.manifest.key]


def test_a_refused_source_leaves_nothing_and_the_next_run_works(cache: Cache) -> None:
    with pytest.raises(CompileError) as caught:
        cache.kernel(BAD, CDEF)
    assert "undeclared" in str(caught.value)
    assert "-shared" in str(caught.value)
    assert entries(cache) == []
    assert added(cache, cache.kernel(ADD, CDEF)) == 3.0


def test_a_failing_compiler_poisons_nothing_for_the_same_compiler_repaired(
    tmp_path: Path, cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", str(compiler_script(tmp_path / "cc", "echo licence expired >&2; exit 7")))
    with pytest.raises(CompileError, match="licence expired") as caught:
        cache.kernel(ADD, CDEF)
    assert caught.value.status == 7
    assert str(tmp_path / "cc") in caught.value.command
    assert entries(cache) == []
    compiler_script(tmp_path / "cc", ":")
    assert added(cache, cache.kernel(ADD, CDEF)) == 3.0


def test_declarations_that_cannot_be_read_leave_nothing(cache: Cache) -> None:
    with pytest.raises(LibraryError, match="declarations"):
        cache.kernel(ADD, "double add(")
    assert entries(cache) == []


def test_a_source_with_a_name_of_the_caches_own_is_refused(cache: Cache) -> None:
    with pytest.raises(ArgumentError, match=r"manifest\.json"):
        cache.kernel({**ADD, "manifest.json": ""}, CDEF)


def test_a_place_that_cannot_be_written_still_works_with_one_warning(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    cache = Cache(tmp_path / "file" / "cache")
    with pytest.warns(CacheWarning, match="Not a directory") as caught:
        kernel = cache.kernel(ADD, CDEF)
    assert str(cache.root) in str(caught[0].message)
    assert len(caught) == 1
    assert not kernel.from_cache
    assert added(cache, kernel) == 3.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = Cache(cache.root).kernel(ADD, CDEF)
        cache.kernel(ADD, CDEF, portable=True)
        cache.remember("scene", kernel, [1])
        recalled = cache.recall("scene")
    assert again.from_cache
    assert again.folder == kernel.folder
    assert recalled is not None
    assert recalled[1] == [1]


@pytest.mark.parametrize("code", [errno.EROFS, errno.ENOSPC, errno.EACCES])
@pytest.mark.parametrize("call", ["mkdir", "rename"])
def test_a_read_only_or_full_disk_still_works_with_a_warning_that_gives_the_reason(
    cache: Cache, monkeypatch: pytest.MonkeyPatch, call: str, code: int
) -> None:
    real = getattr(os, call)

    def refuse(path: object, *args: object, **kwargs: object) -> object:
        if Path(str(path)).parent in (cache.root, cache.root / "kernels"):
            raise OSError(code, os.strerror(code), str(path))
        return real(path, *args, **kwargs)

    monkeypatch.setattr(os, call, refuse)
    with pytest.warns(CacheWarning, match=os.strerror(code)):
        kernel = cache.kernel(ADD, CDEF)
    assert not kernel.folder.is_relative_to(cache.root)
    assert added(cache, kernel) == 3.0
    assert entries(cache) == []


def test_a_disk_that_fills_up_while_writing_leaves_nothing_and_still_works(
    cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = Path.write_bytes

    def full(path: Path, data: bytes) -> int:
        if path.is_relative_to(cache.root) and path.name == "add.h":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return real(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.warns(CacheWarning, match="No space left"):
        kernel = cache.kernel(ADD, CDEF)
    assert added(cache, kernel) == 3.0
    assert entries(cache) == []


def test_a_compiler_that_finds_the_disk_full_is_run_again_elsewhere(
    tmp_path: Path, cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = f'case "$PWD" in {cache.root}*) echo "kernel.so: No space left on device" >&2; exit 1;; esac'
    monkeypatch.setenv("CC", str(compiler_script(tmp_path / "cc", full)))
    with pytest.warns(CacheWarning, match="no space left"):
        kernel = cache.kernel(ADD, CDEF)
    assert added(cache, kernel) == 3.0
    assert entries(cache) == []


def test_a_read_only_cache_that_is_filled_serves_without_a_warning(
    cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    kernel = cache.kernel(ADD, CDEF)
    cache.remember("scene", kernel, None)

    def refuse(path: object, *args: object, **kwargs: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    for call in ("mkdir", "rename", "replace", "unlink"):
        monkeypatch.setattr(os, call, refuse)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fresh = Cache(cache.root)
        assert fresh.recall("scene") is not None
        assert added(fresh, fresh.kernel(ADD, CDEF)) == 3.0


def test_the_substitute_of_an_unwritable_cache_is_removed_at_exit(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    command = [sys.executable, "-c", CLIENT, str(tmp_path / "file" / "cache")]
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    value, from_cache, folder = answer.stdout.split()
    assert (value, from_cache) == ("3.0", "False")
    assert answer.stderr.count("CacheWarning") == 1
    assert not Path(folder).parents[1].exists()


def test_a_recipe_recalls_its_kernel_and_payload_in_another_cache_object(cache: Cache) -> None:
    kernel = cache.kernel(ADD, CDEF)
    payload = {"operations": [1, 2.5, None], "name": "one sphere"}
    cache.remember("scene", kernel, payload)
    recalled = Cache(cache.root).recall("scene")
    assert recalled is not None
    assert recalled[0].folder == kernel.folder
    assert recalled[0].from_cache
    assert recalled[1] == payload
    assert cache.recall("another scene") is None


def test_a_recipe_is_bound_to_its_compiler_and_flags(cache: Cache) -> None:
    cache.remember("scene", cache.kernel(ADD, CDEF), "native")
    assert cache.recall("scene", portable=True) is None
    assert cache.recall("scene", extra_flags=("-O2",)) is None
    assert cache.recall("scene", toolchain=replace(cache.toolchain(), version="gcc version 99")) is None
    cache.remember("scene", cache.kernel(ADD, CDEF, portable=True), "portable")
    assert [recalled[1] for p in (False, True) if (recalled := cache.recall("scene", portable=p))] == [
        "native",
        "portable",
    ]


def test_a_recipe_that_is_cut_short_or_whose_kernel_is_gone_recalls_nothing(cache: Cache) -> None:
    kernel = cache.kernel(ADD, CDEF)
    cache.remember("scene", kernel, None)
    for path in (cache.root / "recipes").iterdir():
        path.write_text(path.read_text()[:20])
    assert cache.recall("scene") is None
    cache.remember("scene", kernel, None)
    assert cache.recall("scene") is not None
    shutil.rmtree(kernel.folder)
    assert cache.recall("scene") is None


def test_a_payload_that_json_cannot_hold_is_refused_before_anything_is_written(cache: Cache) -> None:
    kernel = cache.kernel(ADD, CDEF)
    with pytest.raises(TypeError):
        cache.remember("scene", kernel, {1, 2})
    assert not (cache.root / "recipes").exists()


def test_a_recipe_built_for_this_processor_is_recalled_when_the_compiler_is_gone(
    cache: Cache, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    cache.remember("scene", cache.kernel(ADD, CDEF), "kept")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("symrender_cg.build.toolchain._zig_wheel", lambda: None)
    recalled = Cache(cache.root).recall("scene")
    assert recalled is not None
    assert added(cache, recalled[0]) == 3.0
    with pytest.raises(CompilerNotFoundError):
        cache.kernel(ADD, CDEF)
    monkeypatch.setenv("CC", "no-such-compiler")  # named, so never passed over
    assert cache.recall("scene") is None
    monkeypatch.delenv("CC")
    monkeypatch.setattr("symrender_cg.build.entries.cpu_identity", lambda: "another machine")
    assert cache.recall("scene") is None


def test_a_warm_start_runs_no_process_and_parses_no_declarations(cache: Cache) -> None:
    kernel = cache.kernel(ADD, CDEF)
    cache.remember("scene", kernel, [7])
    program = f"""
import sys
def watch(event, args):
    if event in ("subprocess.Popen", "os.system", "os.fork", "os.forkpty", "os.exec", "os.posix_spawn", "os.spawn"):
        raise SystemExit("a process was started: " + repr(args))
sys.addaudithook(watch)
sys.path.insert(0, {str(ROOT)!r})
from symrender_cg.build import Cache
cache = Cache({str(cache.root)!r})
kernel, payload = cache.recall("scene")
direct = cache.kernel({ADD!r}, {CDEF!r})
print(cache.load(kernel).lib.add(1.0, 2.0), payload, kernel.folder == direct.folder, direct.from_cache)
print(sorted({{"cffi", "pycparser", "subprocess", "sympy", "platformdirs"}} & set(sys.modules)))
"""
    answer = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout.splitlines() == ["3.0 [7] True True", "[]"]


def test_a_warm_kernel_in_the_same_process_runs_no_process(cache: Cache, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.kernel(ADD, CDEF)
    monkeypatch.setattr(subprocess, "Popen", no_process)
    assert Cache(cache.root).kernel(ADD, CDEF).from_cache


def test_clear_removes_every_entry_and_nothing_else(cache: Cache) -> None:
    assert cache.size() == CacheSize(0, 0, 0)
    library = cache.load(cache.kernel(ADD, CDEF))
    cache.remember("scene", cache.kernel(ADD, CDEF, portable=True), None)
    (cache.root / "letter.txt").write_text("mine")
    before = cache.size()
    assert before.kernels == 2
    assert before.recipes == 2  # one for this compiler, one for a machine without any
    assert before.bytes > 10_000
    assert cache.clear() == before
    assert cache.size() == CacheSize(0, 0, 0)
    assert (cache.root / "letter.txt").read_text() == "mine"
    assert library.lib.add(1.0, 2.0) == 3.0
    assert cache.recall("scene") is None
    assert not cache.kernel(ADD, CDEF).from_cache


def test_the_place_is_the_argument_then_the_variable_then_what_platformdirs_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import platformdirs

    monkeypatch.setenv("SYMRENDER_CACHE_DIR", str(tmp_path / "variable"))
    assert Cache(tmp_path / "argument").root == tmp_path / "argument"
    assert Cache().root == default_root() == tmp_path / "variable"
    monkeypatch.delenv("SYMRENDER_CACHE_DIR")
    for setting in (None, "", str(tmp_path / "xdg"), "relative/place"):
        if setting is None:
            monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
        else:
            monkeypatch.setenv("XDG_CACHE_HOME", setting)
        assert default_root() == Path(platformdirs.user_cache_dir("symrender_cg"))
