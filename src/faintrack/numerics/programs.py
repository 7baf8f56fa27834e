"""Whole programs kept between processes: what one has traced and compiled, the next one loads and runs.

JAX's own cache keeps what XLA has compiled, and finds it by the program's text. To have the text, Python traces the
function again in every process, for seconds where it is a tracker. Here a program is found by what its text follows
from: the function, the shapes and types of the arrays that it takes, everything else in its arguments, the source of
this package, the versions of what it stands on, and the machine. Where any of these cannot be told, as with a function
of the user's own, nothing is kept and the function is compiled as usual.

Programs lie beside what JAX keeps, in the user's own folder for caches, and only where `keep_compilations` has chosen
it. Those that were not used for a month are removed.
"""

import dataclasses
import enum
import functools
import hashlib
import inspect
import os
import pickle
import platform
import sys
import tempfile
import time
import types
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jaxlib
import numpy as np
import scipy
from jax.experimental import serialize_executable
from jax.experimental.compilation_cache import compilation_cache

from faintrack.numerics.compiled import cache_folder

ROOTS = {"faintrack", "jax", "jaxlib", "equinox", "numpy", "scipy", "builtins", "functools", "math"}
"""Packages whose functions are known by name: the versions of all are part of what a program is found by."""

SETTINGS = "enable_x64", "default_matmul_precision", "default_device"
"""Of JAX, that a program follows from."""

LASTING = 30 * 86_400.0
"""Seconds for which a program is kept that is not used."""

HELD = 16
"""Programs that are held in a process at most."""

DIGEST = 32
"""Bytes that a file begins with, the digest of the others."""

Program = Callable[..., Any]
_held: OrderedDict[str, Program] = OrderedDict()


class Unknown(Exception):
    """Something whose part in a program cannot be told."""


def kept(function: Callable[..., Any], *arguments: Any) -> Program:
    """A compiled program of a function for arguments like these.

    Parameters
    ----------
    function : pure; of this package, at the top of a module.
    arguments : trees of arrays, and of anything else that stays as it is.

    Returns
    -------
    Function of arguments that differ from these by the values of their arrays alone. Where the program cannot be kept,
    it is `equinox.filter_jit` of the function.

    Examples
    --------
    >>> from faintrack.numerics.trigonometry import sine_cosine
    >>> sine, cosine = kept(sine_cosine, jnp.ones(2))(jnp.zeros(2))
    >>> sine.tolist(), cosine.tolist()
    ([0.0, 0.0], [1.0, 1.0])
    """
    folder = _folder()
    if folder is None or jax.config.values.get("jax_disable_jit") or jax.config.values.get("jax_debug_nans"):
        return _compiled(function)
    try:
        name = fingerprint(function, arguments)
    # Keys that have no order, cells that are empty, what holds itself: unknown as well.
    except (Unknown, TypeError, ValueError, RecursionError):
        return _compiled(function)
    if name not in _held:
        _held[name] = _loaded(folder / name) or _made(folder / name, function, arguments)
    _held.move_to_end(name)
    while len(_held) > HELD:
        _held.popitem(last=False)
    return _held[name]


@functools.cache
def _compiled(function: Callable[..., Any]) -> Program:
    program: Program = eqx.filter_jit(function)
    return program


def fingerprint(function: Callable[..., Any], arguments: Any) -> str:
    """What a program is found by, as hexadecimal digits.

    Raises
    ------
    Unknown : something among the arguments or the function is not known by name.

    Examples
    --------
    >>> from faintrack.numerics.trigonometry import sine_cosine
    >>> one, two, three = (fingerprint(sine_cosine, values) for values in (jnp.ones(2), jnp.zeros(2), jnp.ones(3)))
    >>> one == two, one == three
    (True, False)
    """
    # As they are here and now: they may be set for a part of a program.
    config = [getattr(jax.config, f"jax_{name}") for name in SETTINGS]
    told = hashlib.sha256(repr((_surroundings(), config)).encode())
    _tell(function, told.update, constant=True)
    _tell(arguments, told.update, constant=False)
    return told.hexdigest()


def _tell(value: Any, tell: Callable[[bytes], None], constant: bool) -> None:
    """Tell what is part of a program; of arrays, unless they are constants of it, shape and type alone."""
    tell(f"<{type(value).__name__}>".encode())
    if isinstance(value, jax.Array | np.ndarray | np.generic):
        if isinstance(value, jax.Array) and jax.dtypes.issubdtype(value.dtype, jax.dtypes.prng_key):
            tell(f"{value.shape} {value.dtype}".encode())
            value = jax.random.key_data(value)
        tell(f"{value.shape} {value.dtype} {getattr(value, 'weak_type', False)}".encode())
        if constant or isinstance(value, np.generic):
            tell(np.asarray(value).tobytes())
    elif value is None or isinstance(value, bool | int | float | complex | str | bytes | np.dtype):
        tell(repr(value).encode())
    elif isinstance(value, enum.Enum):
        tell(_name(type(value)) + value.name.encode())
    elif isinstance(value, type):
        tell(_name(value))
    elif isinstance(value, tuple | list):
        tell(_name(type(value)) + str(len(value)).encode())
        _tell_all(value, tell, constant)
    elif isinstance(value, dict):
        _tell_all(sorted(value), tell, True)
        _tell_all((value[key] for key in sorted(value)), tell, constant)
    elif isinstance(value, functools.partial):
        _tell_all((value.func, value.args, value.keywords), tell, constant)
    elif isinstance(value, types.MethodType):
        _tell_all((value.__self__, value.__func__), tell, constant)
    elif dataclasses.is_dataclass(value):
        tell(_name(type(value)))
        for field in dataclasses.fields(value):
            tell(field.name.encode())
            held = getattr(value, field.name, None)
            _tell(held, tell, constant or bool(field.metadata.get("static")) or not isinstance(value, eqx.Module))
    elif isinstance(value, types.FunctionType):
        # A decorator is part of the source.
        value = inspect.unwrap(value)
        tell(_name(value))
        _tell_all((value.__defaults__, value.__kwdefaults__), tell, True)
        _tell_all((cell.cell_contents for cell in value.__closure__ or ()), tell, True)
    elif isinstance(value, types.BuiltinFunctionType | np.ufunc):
        tell(getattr(value, "__name__").encode())  # noqa: B009
    elif callable(value) and hasattr(value, "__wrapped__"):
        # What jit and cache have made of a function.
        _tell(value.__wrapped__, tell, True)
    else:
        raise Unknown(repr(value)[:100])


def _tell_all(values: Iterable[Any], tell: Callable[[bytes], None], constant: bool) -> None:
    for value in values:
        _tell(value, tell, constant)


def _name(of: Any) -> bytes:
    """Of a function or class of a package that is known by its version."""
    module, full = getattr(of, "__module__", None), getattr(of, "__qualname__", None)
    if module is None or full is None or module.partition(".")[0] not in ROOTS:
        raise Unknown(repr(of)[:100])
    return f"{module}:{full}".encode()


@functools.cache
def _surroundings() -> str:
    """Source of this package, versions, and machine: what all programs follow from."""
    source = hashlib.sha256()
    root = Path(__file__).parent.parent
    for path in sorted(root.rglob("*.py")):
        source.update(str(path.relative_to(root)).encode() + path.read_bytes())
    try:
        # Programs hold instructions that another processor of the same kind may not have.
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        processor = next((line for line in told if line.startswith(("flags", "Features"))), "")
    except OSError:
        processor = platform.processor()
    devices = [(device.platform, device.device_kind) for device in jax.local_devices()]
    versions = (sys.version, jax.__version__, jaxlib.__version__, eqx.__version__, np.__version__, scipy.__version__)
    flags = os.environ.get("XLA_FLAGS")
    return repr((source.hexdigest(), versions, flags, devices, platform.machine(), processor))


def _folder() -> Path | None:
    """Where programs are kept; None where the user has named a folder for JAX alone, or none can be written."""
    chosen = cache_folder()
    if chosen is None or jax.config.values.get("jax_compilation_cache_dir") != str(chosen):
        return None
    folder = chosen / "programs"
    try:
        folder.mkdir(exist_ok=True)
    except OSError:
        return None
    return folder


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array | np.ndarray)


def _leaves(arguments: Any) -> list[Any]:
    return [leaf for leaf in jax.tree.leaves(arguments) if _is_array(leaf)]


def _called(executable: Callable[..., Any], shape: Any) -> Program:
    """Program of an executable that takes and gives arrays in a row.

    Parameters
    ----------
    executable : of the arrays among the arguments.
    shape : tree of what the function gives, with the number of an array in the place of each.
    """

    def program(*arguments: Any) -> Any:
        given = executable(*_leaves(arguments))
        return jax.tree.map(lambda place: given[place] if isinstance(place, _Place) else place, shape)

    return program


class _Place(int):
    """Number of an array in a row."""


def _made(path: Path, function: Callable[..., Any], arguments: Any) -> Program:
    """Compile a program, and keep it where that can be."""
    arrays, rest = eqx.partition(arguments, _is_array)
    leaves, tree = jax.tree.flatten(arrays)
    shapes: list[Any] = []

    def in_a_row(*leaves: Any) -> tuple[Any, ...]:
        given = function(*eqx.combine(jax.tree.unflatten(tree, leaves), rest))
        arrays, other = eqx.partition(given, _is_array)
        row, structure = jax.tree.flatten(arrays)
        shapes[:] = [eqx.combine(jax.tree.unflatten(structure, [_Place(n) for n in range(len(row))]), other)]
        return tuple(row)

    lowered = jax.jit(in_a_row).lower(*leaves)
    with _anew():
        executable = lowered.compile()
    (shape,) = shapes
    try:
        payload, taken, given = serialize_executable.serialize(executable)
        content = pickle.dumps((payload, taken, given, shape))
        _write(path, hashlib.sha256(content).digest() + content)
    # A program that cannot be kept is still a program.
    except Exception:
        pass
    return _called(executable, shape)


@contextmanager
def _anew() -> Iterator[None]:
    """Have JAX compile: what it has read from its own cache cannot be written again."""
    name = "jax_enable_compilation_cache"
    before = jax.config.values.get(name)
    try:
        jax.config.update(name, False)
        compilation_cache.reset_cache()
        yield
    finally:
        jax.config.update(name, before)
        compilation_cache.reset_cache()


def _loaded(path: Path) -> Program | None:
    """Program of a file; None where there is none, or none that can be read."""
    try:
        written = path.read_bytes()
        digest, content = written[:DIGEST], written[DIGEST:]
        if hashlib.sha256(content).digest() != digest:
            return None
        _prepare()
        payload, taken, given, shape = pickle.loads(content)
        executable = serialize_executable.deserialize_and_load(payload, taken, given)
        path.touch()
    # Whatever is raised by a file that was cut short: the program is made again.
    except Exception:
        return None
    return _called(executable, shape)


@functools.cache
def _prepare() -> None:
    """Have JAX bind the functions of LAPACK, which it does when it first lowers a call of one.

    A program that was loaded calls them without ever being lowered.
    """
    jax.jit(jnp.linalg.cholesky).lower(jnp.eye(1))


def _write(path: Path, content: bytes) -> None:
    """Write a file beside its place and rename it; remove those that were not used for long."""
    handle, name = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(name).replace(path)
    finally:
        Path(name).unlink(missing_ok=True)
    for other in path.parent.iterdir():
        if time.time() - other.stat().st_mtime > LASTING:
            other.unlink(missing_ok=True)
