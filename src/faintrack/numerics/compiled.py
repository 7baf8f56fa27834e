"""Programs that JAX has compiled, kept between processes: what one has compiled, the next one reads.

A first result takes seconds of compilation. `keep_compilations` has JAX write what it compiles to the user's folder for
caches, where the next process finds it. Call it before a first result; what was compiled before is not kept.
It never fails: where nothing can be written, every process compiles for itself.
"""

import os
import sys
import tempfile
from pathlib import Path

import jax
from jax.experimental.compilation_cache import compilation_cache


def cache_folder() -> Path | None:
    """Folder for compiled programs, made where it is not there yet; None where it cannot be written.

    It is `faintrack` in the user's folder for caches: that of `XDG_CACHE_HOME` where it is set, else
    `%LOCALAPPDATA%` on Windows, `~/Library/Caches` on macOS, `~/.cache` elsewhere.

    Examples
    --------
    >>> folder = cache_folder()
    >>> folder is None or folder.is_dir()
    True
    """
    usual = {"win32": os.environ.get("LOCALAPPDATA") or "~/AppData/Local", "darwin": "~/Library/Caches"}
    try:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or usual.get(sys.platform, "~/.cache"))
        folder = caches.expanduser() / "faintrack"
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except (OSError, RuntimeError):
        # Without a home folder, `expanduser` raises a RuntimeError.
        return None


def keep_compilations() -> None:
    """Let JAX keep what it compiles in `cache_folder`, unless the user has named a folder of their own.

    `JAX_COMPILATION_CACHE_DIR`, or `jax_compilation_cache_dir` of JAX's configuration, names one; both stay as they
    are, and so do the user's thresholds on what is worth keeping.

    Examples
    --------
    >>> keep_compilations()
    """
    if "JAX_COMPILATION_CACHE_DIR" in os.environ or jax.config.values.get("jax_compilation_cache_dir"):
        return
    folder = cache_folder()
    if folder is None:
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    # JAX decides once a process whether it keeps anything, and may have done so before.
    compilation_cache.reset_cache()
