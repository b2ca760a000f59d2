"""Offscreen OpenGL context by EGL, without a window, a screen or further libraries."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

LIBRARY = "libEGL.so.1"

NEEDS = "on Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri"
"""Remedy where EGL or a driver for it is missing; the driver renders on the processor
where there is no GPU."""

MOST_DEVICES = 16
"""Number of EGL devices that are tried, chosen above that of a machine's GPUs."""

PLATFORM_DEVICE = 0x313F
OPENGL_API = 0x30A2
CONFIG = (
    0x3024,
    8,
    0x3023,
    8,
    0x3022,
    8,
    0x3021,
    8,
    0x3025,
    24,
    0x3026,
    8,
    0x3033,
    0x0001,
    0x3040,
    0x0008,
    0x3038,
)
"""EGL configuration: red, green, blue, alpha 8 bits, depth 24, stencil 8, for a pixel
buffer (0x3033) and OpenGL (0x3040); 0x3038 ends it."""

_Pointer = ctypes.c_void_p

CType = type[ctypes.c_void_p] | type[ctypes.c_int] | type[ctypes.c_uint]
"""Type of a C function's result or argument."""


class NoDisplayError(ValueError):
    """Error if images cannot be rendered on this machine; names the missing library."""


@contextmanager
def offscreen() -> Iterator[Callable[[], None]]:
    """Context manager with an OpenGL context that needs no window; yields a function
    that makes it current.

    Yields a function that makes it current again, after another one was.

    Raises:
        NoDisplayError: one line: no EGL, or no driver that draws with it.
    """
    # macOS and Windows have no EGL
    if not sys.platform.startswith("linux"):
        with _of_mujoco() as current:
            yield current
        return
    egl = _library()
    display, config = _display(egl)
    context = egl.eglCreateContext(display, config, None, None)

    def current() -> None:
        if not context or not egl.eglMakeCurrent(display, None, None, context):
            raise NoDisplayError(
                f"EGL: has no OpenGL context (error {egl.eglGetError():#x}); {NEEDS}"
            )

    current()
    try:
        yield current
    finally:
        egl.eglMakeCurrent(display, None, None, None)
        egl.eglDestroyContext(display, context)


@contextmanager
def _of_mujoco() -> Iterator[Callable[[], None]]:
    """Context manager with MuJoCo's own OpenGL context, for macOS and Windows."""
    import mujoco

    try:
        # no picture has this size: each is drawn into a buffer of its own
        context = mujoco.gl_context.GLContext(64, 64)
        context.make_current()
    except Exception as error:  # each system has errors of its own
        raise NoDisplayError(
            f"OpenGL: {error}; python -m pip install glfw pyopengl"
        ) from None
    try:
        yield context.make_current
    finally:
        context.free()


def _library() -> ctypes.CDLL:
    """Load the EGL library and declare its function types."""
    try:
        egl = ctypes.CDLL(LIBRARY)
    except OSError:
        raise NoDisplayError(
            f"{LIBRARY}: is missing, which draws without a screen; {NEEDS}"
        ) from None
    # pointers are 64 bits wide: undeclared, C functions are taken to return 32
    egl.eglGetProcAddress.restype = _Pointer
    egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
    egl.eglInitialize.argtypes = [_Pointer] * 3
    egl.eglChooseConfig.argtypes = [
        _Pointer,
        _Pointer,
        _Pointer,
        ctypes.c_int,
        _Pointer,
    ]
    egl.eglCreateContext.restype = _Pointer
    egl.eglCreateContext.argtypes = [_Pointer] * 4
    egl.eglMakeCurrent.argtypes = [_Pointer] * 4
    egl.eglDestroyContext.argtypes = [_Pointer] * 2
    return egl


def _display(egl: ctypes.CDLL) -> tuple[int, int]:
    """Find an EGL display and configuration that render OpenGL."""
    for device in _devices(egl):
        display = _extension(
            egl,
            b"eglGetPlatformDisplayEXT",
            _Pointer,
            ctypes.c_uint,
            _Pointer,
            _Pointer,
        )(PLATFORM_DEVICE, device, None)
        # a device without a driver for OpenGL must not hide a later one that has it
        if not display or not egl.eglInitialize(display, None, None):
            continue
        config = (_Pointer * 1)()
        count = ctypes.c_int()
        attributes = (ctypes.c_int * len(CONFIG))(*CONFIG)
        chosen = egl.eglChooseConfig(
            display, attributes, config, 1, ctypes.byref(count)
        )
        if chosen and count.value and egl.eglBindAPI(OPENGL_API):
            # ctypes has None for a null pointer
            return display, config[0] or 0
    raise NoDisplayError(f"EGL: finds no device that draws with OpenGL; {NEEDS}")


def _devices(egl: ctypes.CDLL) -> list[int]:
    """List the EGL devices of this machine."""
    devices = (_Pointer * MOST_DEVICES)()
    count = ctypes.c_int()
    query = _extension(
        egl, b"eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, _Pointer, _Pointer
    )
    query(MOST_DEVICES, devices, ctypes.byref(count))
    return [device for device in devices[: count.value] if device]


def _extension(
    egl: ctypes.CDLL, name: bytes, result: CType, *arguments: CType
) -> Callable[..., Any]:
    """Load an EGL extension function by name.

    Raises:
        NoDisplayError: it has no such function.
    """
    address = egl.eglGetProcAddress(name)
    if not address:
        raise NoDisplayError(f"EGL: has no {name.decode()}; {NEEDS}")
    return ctypes.CFUNCTYPE(result, *arguments)(address)
