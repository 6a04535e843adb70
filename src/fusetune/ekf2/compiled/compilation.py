"""Compile the estimator in one piece, in a process of its own, and keep it in the kernel cache.

Numba optimises and translates every function by itself, each time together with everything it calls: the estimator's
few hundred nested functions would pass through the optimiser some thirty times. Here the inner functions are only
translated to LLVM's language, without the wrappers by which Python and C would call them; at the entry all are linked,
as functions that nobody else calls, and optimised once. They cannot be called from Python in a process that compiled
this way, so it is a child that does it; everybody else loads the result.
"""

from __future__ import annotations

import gc
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba.core import (
    base,
    codegen,
    compiler,
    config,
    cpu,
    event,
    interpreter,
    lowering,
    postproc,
    transforms,
    typed_passes,
    typeinfer,
    types,
    typing,
    untyped_passes,
)
from numba.core import ir as numba_ir

from fusetune.ekf2.compiled.carried_kernels import carried_folder, may_be_taken, take_over
from fusetune.ekf2.compiled.kernel_cache import (
    COMPILES,
    LOCATOR,
    RECORD_NAME,
    keep_others_out,
    others_may_write_kernels,
)
from fusetune.ekf2.compiled.kernel_locator import KernelLocator, processor
from fusetune.errors import UserError
from fusetune.px4.releases import BASELINE, name_of
from fusetune.storage.file_lock import LocksUnavailableError, lock
from fusetune.storage.files import atomic_path

PLAIN_TEXT = name_of(BASELINE)
"""The release of PX4 whose behaviour the kernels have that are compiled for no other."""
LOCK_NAME = "compile.lock"
RELEASES_NAME = "releases.json"
ENTRY_SOURCE = Path(__file__).parents[1] / "replay" / "loop.py"
CHILD_MARK = "FUSETUNE_COMPILING"
LINKED_TOGETHER = 25
"""As many modules are linked before the result is linked to the entry: LLVM looks through all of that each time."""
PASSES_FOR_OTHERS = (
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.RewriteSemanticConstants,
    untyped_passes.DeadBranchPrune,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.InlineInlinables,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.NopythonRewrites,
    typed_passes.DumpParforDiagnostics,
)
"""Passes of Numba for closures, lists, array expressions, exceptions and the like, of which kernels have none.

What these would simplify besides, branches that a constant decides, LLVM simplifies as well.
"""
PLAIN = "--plain"
ONLY_LOADS = "--only-loads"
OF_RELEASE = "--release"
"""Followed by the release of PX4 whose kernels are compiled; without it, those of the plain text."""
NOT_IN_ONE_PIECE = (
    f"Numba {numba.__version__} does not compile the estimator in one piece: it is done function by function, "
    "which takes some minutes longer and gives the same results."
)


@cache
def ensure_compiled(release: str = PLAIN_TEXT) -> None:
    """Make sure the kernel cache holds the estimator for this processor; one process compiles and others wait.

    That of another release of PX4 is compiled when it is first asked for, and kept beside what is there.

    Kernels that have lost or changed a byte, or that others could have written, are made again. Does nothing where
    Numba is switched off. What cannot be compiled in one piece is compiled the usual, slower way, after a warning.

    Raises
    ------
    UserError
        The cache belongs to another user, or it lacks the kernels and cannot be written.
    """
    if _setting("DISABLE_JIT") or CHILD_MARK in os.environ:
        return
    caches, folder = Path(_setting("CACHE_DIR")), kernel_folder()
    if _may_be_loaded(folder) and release in _compiled_releases(folder):
        return
    try:
        caches.mkdir(parents=True, exist_ok=True)
        queue = (caches / LOCK_NAME).open("w+b")
    except OSError as error:
        reason = f"does not hold the estimator for this processor, and cannot be written ({error.strerror})"
        raise UserError(caches, reason, "Start the pipeline where it can, or make room") from error
    with queue:
        with suppress(LocksUnavailableError):  # then each process compiles for itself
            lock(queue, exclusive=True, wait=True)
        intact = _may_be_loaded(folder)
        if not intact:
            keep_others_out(folder)
            _empty(folder)
            intact = _take_carried(caches, folder)
        if not (intact and release in _compiled_releases(folder)):
            told, options = ("", ()) if release == PLAIN_TEXT else (f" of {release}", (OF_RELEASE, release))
            print(f"Compiling the estimator{told} for this processor ...", file=sys.stderr)
            _compile(caches, *options)
            if not _may_be_loaded(folder):
                print(NOT_IN_ONE_PIECE, file=sys.stderr)
                _compile(caches, *options, PLAIN)


def is_compiled() -> bool:
    """Whether the kernel cache holds the estimator for this processor, and it may be loaded from there."""
    return not _setting("DISABLE_JIT") and _may_be_loaded(kernel_folder())


def _empty(folder: Path) -> None:
    for file in folder.iterdir():
        file.unlink()  # Numba would stumble over a damaged one


def _take_carried(caches: Path, folder: Path) -> bool:
    """Take over what an installed package carries for processors like this one, if another process can run it."""
    carried = carried_folder()
    if not may_be_taken(carried) or not _is_whole(carried):
        return False
    take_over(carried, folder, processor())
    if _compile(caches, ONLY_LOADS) == 0:
        _record(folder)
        return True
    _empty(folder)
    return False


def _compiled_releases(folder: Path) -> list[str]:
    """Releases of PX4 whose kernels are in a folder."""
    try:
        return list(json.loads((folder / RELEASES_NAME).read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return [PLAIN_TEXT]


def _compile(caches: Path, *options: str) -> int:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(caches), "NUMBA_CACHE_LOCATOR_CLASSES": LOCATOR}
    command, quiet = [sys.executable, "-m", COMPILES, *options], None
    if ONLY_LOADS in options:
        environment[CHILD_MARK], quiet = "1", subprocess.DEVNULL
    return subprocess.run(command, env=environment, umask=0o022, stderr=quiet, check=False).returncode


def _setting(name: str) -> Any:
    """A setting of Numba, which makes them up as module attributes when it is imported."""
    return getattr(config, name)


def kernel_folder() -> Path:
    """Where in the cache the kernels of this processor are."""
    return Path(_setting("CACHE_DIR")) / KernelLocator.get_suitable_cache_subpath(str(ENTRY_SOURCE))


def _kernel_files(folder: Path) -> dict[str, str]:
    """Digest of each of Numba's files in a folder."""
    files = sorted(file for file in folder.glob("*") if file.suffix in (".nbi", ".nbc"))
    return {file.name: hashlib.blake2b(file.read_bytes()).hexdigest() for file in files}


def _may_be_loaded(folder: Path) -> bool:
    """Whether a folder holds the kernels as they were compiled, byte for byte, and others cannot have written them."""
    return not others_may_write_kernels(folder) and _is_whole(folder)


def _is_whole(folder: Path) -> bool:
    """Whether a folder holds the kernels as they were compiled, byte for byte."""
    try:
        recorded = json.loads((folder / RECORD_NAME).read_text(encoding="utf-8"))
        return bool(recorded) and recorded == _kernel_files(folder)
    except (OSError, ValueError):
        return False


@contextmanager
def joined_without_optimising() -> Iterator[None]:
    """Join functions as they are compiled; only what is compiled last, the entry, is optimised and translated.

    This replaces methods of Numba's code generator, which another release may have otherwise: `pyproject.toml` bounds
    Numba from above, a test compares what is computed with what Numba compiles its own way, bit by bit, and where the
    child fails the warning says so.
    """
    library, native = codegen.JITCodeLibrary, codegen.JITCPUCodegen
    finalize, pointer, set_env = library.finalize, library.get_pointer_to_function, native.set_env
    add_module, compile_function = library.add_llvm_module, compiler.CompilerBase.compile_extra
    passes, call_type = compiler.DefaultPassBuilder.define_nopython_pipeline, types.BaseFunction.get_call_type
    size_of, has_loc, type_of_attribute = base.BaseContext.get_abi_sizeof, base._has_loc, typing.Context.resolve_getattr
    depth = 0
    call_types: dict[Any, Any] = {}
    sizes: dict[str, int] = {}
    with_loc: dict[Any, bool] = {}
    fields: dict[tuple[types.Record, str], Any] = {}

    def remembered_has_loc(implementation):  # type: ignore[no-untyped-def]
        code = getattr(implementation, "__code__", None)
        if code is None or hasattr(implementation, "__wrapped__"):
            return has_loc(implementation)
        if code not in with_loc:
            with_loc[code] = has_loc(implementation)
        return with_loc[code]

    def remembered_field(self, owner, name):  # type: ignore[no-untyped-def]
        if not isinstance(owner, types.Record):
            return type_of_attribute(self, owner, name)
        if (owner, name) not in fields:
            fields[owner, name] = type_of_attribute(self, owner, name)
        return fields[owner, name]

    def remembered_size(self, llvm_type):  # type: ignore[no-untyped-def]
        name = str(llvm_type)
        if name not in sizes:
            sizes[name] = size_of(self, llvm_type)
        return sizes[name]

    def passes_that_act(state, name="nopython"):  # type: ignore[no-untyped-def]
        manager = compiler.PassManager(name)
        for compiler_pass, description in passes(state, name).passes:
            if compiler_pass not in PASSES_FOR_OTHERS:
                manager.add_pass(compiler_pass, description)
        manager.finalize()
        return manager

    def remembered_call_type(self, context, arguments, named):  # type: ignore[no-untyped-def]
        call = (self, context, arguments, tuple(named.items()))
        if call not in call_types:
            call_types[call] = call_type(self, context, arguments, named)
        return call_types[call]

    def compile_without_wrappers(self, function):  # type: ignore[no-untyped-def]
        nonlocal depth
        depth += 1
        if depth > 1:
            self.state.flags.no_cpython_wrapper = self.state.flags.no_cfunc_wrapper = True
        try:
            return compile_function(self, function)
        finally:
            depth -= 1

    def add_unoptimised(self, module):  # type: ignore[no-untyped-def]
        if depth <= 1:
            return add_module(self, module)
        module.data_layout = self._codegen._data_layout
        return self._final_module.link_in(module)

    def join(self):  # type: ignore[no-untyped-def]
        if depth <= 1:
            _link_all_called(self)
            return finalize(self)
        self._raise_if_finalized()
        for called in self._linking_libraries:
            self._reload_init.update(called._reload_init)
        self._finalize_dynamic_globals()
        self._shared_module = self._final_module
        self._finalized = True
        self._only_joined = True
        return None

    def for_the_cache(self):  # type: ignore[no-untyped-def]
        self._ensure_finalized()
        return self.name, "object", (self._get_compiled_object(), _names_alone(self).as_bitcode())

    def pointer_if_translated(self, name):  # type: ignore[no-untyped-def]
        self._ensure_finalized()
        return 0 if getattr(self, "_only_joined", False) else pointer(self, name)

    def set_env_if_translated(self, name, env):  # type: ignore[no-untyped-def]
        if self._engine.is_symbol_defined(name):
            set_env(self, name, env)

    patches: tuple[tuple[Any, str, Any], ...] = (
        (library, "finalize", join),
        (library, "_optimize_final_module", _optimize_once),
        (library, "add_llvm_module", add_unoptimised),
        (library, "serialize_using_object_code", for_the_cache),
        (library, "get_pointer_to_function", pointer_if_translated),
        (native, "set_env", set_env_if_translated),
        (compiler.CompilerBase, "compile_extra", compile_without_wrappers),
        (compiler.DefaultPassBuilder, "define_nopython_pipeline", staticmethod(passes_that_act)),
        (types.BaseFunction, "get_call_type", remembered_call_type),
        (lowering.Lower, "delvar", _nothing),
        (lowering, "new_error_context", _no_context),
        (typeinfer, "new_error_context", _no_context),
        (numba_ir.Inst, "_rec_list_vars", _variables_in),
        (postproc.PostProcessor, "run", _canonicalize),
        (interpreter, "peep_hole_delete_with_exit", _as_it_is),
        (interpreter, "peep_hole_fuse_dict_add_updates", _as_it_is),
        (cpu.CPUContext, "get_abi_sizeof", remembered_size),
        (base, "_has_loc", remembered_has_loc),
        (typing.Context, "resolve_getattr", remembered_field),
        (numba_ir.Assign, "__str__", object.__repr__),
        (event, "start_event", _nothing),
        (event, "end_event", _nothing),
        (types.Record, "__repr__", _short_repr),
    )
    originals = [vars(owner).get(name) for owner, name, _ in patches]
    try:
        for owner, name, replacement in patches:
            setattr(owner, name, replacement)
        yield
    finally:
        for (owner, name, _), original in zip(patches, originals, strict=True):
            if original is None:
                delattr(owner, name)
            else:
                setattr(owner, name, original)


def _link_all_called(entry: Any) -> None:
    """Link what the entry calls, at any depth, into its module, as functions that nothing outside it can call.

    That they cannot be called otherwise lets the optimiser change what they take and return.
    """
    every = _with_all_they_call(entry._linking_libraries)
    joined = [library._final_module for library in every if getattr(library, "_only_joined", False)]
    entry._linking_libraries = [library for library in every if not getattr(library, "_only_joined", False)]
    called = []
    for first in range(0, len(joined), LINKED_TOGETHER):
        part = llvm.parse_assembly(str(entry._codegen._create_empty_module("part")))
        for module in joined[first : first + LINKED_TOGETHER]:
            called += [f.name for f in module.functions if not f.is_declaration and f.linkage == llvm.Linkage.external]
            part.link_in(module, preserve=True)
        entry._final_module.link_in(part)
    for name in called:
        entry._final_module.get_function(name).linkage = llvm.Linkage.internal


def _optimize_once(entry: Any) -> None:
    """Optimise the entry's module, without a pass before that serves references, or one that found nothing to join."""
    manager, builder = entry._codegen._module_pass_manager(slp_vectorize=False)
    manager.run(entry._final_module, builder)


def _names_alone(entry: Any) -> Any:
    """A module for the cache in place of the entry's own, which nobody links there: it tells what the code defines."""
    stub, module = entry._codegen._create_empty_module(entry.name), entry._final_module
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.linkage not in (llvm.Linkage.internal, llvm.Linkage.private):
            ir.GlobalVariable(stub, ir.IntType(8), value.name).initializer = ir.IntType(8)(0)
    return llvm.parse_assembly(str(stub))


def _with_all_they_call(libraries: Iterable[Any], found: dict[Any, None] | None = None) -> dict[Any, None]:
    """Libraries and those that they link, and so on, each once."""
    found = {} if found is None else found
    for library in libraries:
        if library not in found:
            _with_all_they_call(library._linking_libraries, found)
            found[library] = None
    return found


def _nothing(*_: object, **__: object) -> None:
    """Numba times itself by some hundred thousand events, and empties variables that own nothing when they end."""


def _as_it_is(blocks: Any) -> Any:
    """Kernels have no `with` and no dictionaries that could be simplified."""
    return blocks


NO_CONTEXT = nullcontext()


def _no_context(*_: object, **__: object) -> nullcontext[None]:
    """In place of what adds the lines of the source to an error; there is none when the usual way compiles."""
    return NO_CONTEXT


HOLD_NO_VARIABLES = frozenset((str, int, float, bool, type(None), numba_ir.Loc, numba_ir.Scope))


def _variables_in(_: object, value: Any) -> list[Any]:
    """Variables that Numba's own representation of a statement mentions, looked for without a call for every part."""
    found: list[Any] = []
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else (value,):
        kind = type(part)
        if kind in HOLD_NO_VARIABLES:
            continue
        if kind is numba_ir.Var:
            found.append(part)
        elif isinstance(part, numba_ir.Inst):
            found += part.list_vars()
        elif isinstance(part, list | tuple | dict):
            found += _variables_in(None, part)
    return found


def _canonicalize(processor: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """Bring the blocks of a function in order, without what generators need and without the ends of variables.

    At the end of variables their references are counted down, and kernels have none. At their first `Del`, though,
    Numba makes room for them, which those need that blocks pass to one another.
    """
    function = processor.func_ir
    function.blocks = transforms.canonicalize_cfg(function.blocks)
    function.variable_lifetime = postproc.VariableLifetime(function.blocks)
    function.generator_info = None
    if emit_dels:
        passed_on = set().union(*function.variable_lifetime.usedefs.usemap.values())
        first = function.blocks[min(function.blocks)]
        for name in sorted(passed_on, reverse=True):
            first.prepend(numba_ir.Del(name, loc=first.loc))


def _short_repr(record: types.Record) -> str:
    """Numba spells out all fields of a record in each of its progress events, a fifth of the time it takes."""
    return f"Record({len(record.fields)} fields, {record.size} bytes)"


def refuse_to_compile() -> None:
    """Let this process fail where it would compile, rather than load from the cache."""

    def refuse(*_: object, **__: object) -> Any:
        raise RuntimeError("the cache does not hold these kernels")

    compiler.compile_extra = refuse


def compile_and_record(call_entry: Callable[[], None], options: Sequence[str] = ()) -> None:
    """Compile by a first call of the entry, and record what is now in the cache; the work of the child process.

    Parameters
    ----------
    options : of the command line; with `PLAIN` Numba compiles its own way
    """
    os.environ[CHILD_MARK] = "1"
    gc.disable()  # hardly anything of what compiling makes is ever let go
    with nullcontext() if PLAIN in options else joined_without_optimising():
        call_entry()
    release = options[options.index(OF_RELEASE) + 1] if OF_RELEASE in options else PLAIN_TEXT
    folder = kernel_folder()
    _record(folder, {*_compiled_releases(folder), release} if (folder / RECORD_NAME).exists() else {release})


def _record(folder: Path, releases: Iterable[str] = (PLAIN_TEXT,)) -> None:
    """Record what is in the cache, and for which releases."""
    for name, content in ((RELEASES_NAME, sorted(releases)), (RECORD_NAME, _kernel_files(folder))):
        with atomic_path(folder / name) as temporary:
            temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
