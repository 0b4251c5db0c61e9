"""Methods of other packages at work: whatever they raise names their package."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout
from numbers import Integral
from pathlib import Path

import numpy as np

from gridslam.core.errors import GridslamError, MethodError, message_of, was_interrupted
from gridslam.core.messages import Event
from gridslam.core.poses import MAX_COORDINATE_M
from gridslam.core.texts import visible
from gridslam.methods.base import Estimate, Method, RunResult


@contextmanager
def naming(package: str, passed: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Turn an error of a method's code into a MethodError that names its `package`; no text: the program's own method.

    What a package prints goes to stderr: stdout has only the result.
    A GridslamError that was raised on purpose, which is one of its children, keeps its message and its kind; so do lack of
    memory, Ctrl-C, and the kinds in `passed`.
    """
    try:
        with redirect_stdout(sys.stderr) if package else nullcontext():
            yield
    except passed:
        raise
    except BaseException as error:  # also those that no `except Exception` stops
        is_ours = isinstance(error, MemoryError) or was_interrupted(error) or _is_on_purpose(error)
        if not package or is_ours:
            raise
        frames = traceback.extract_tb(error.__traceback__)
        place = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
        raise MethodError(
            f"{package}: {type(error).__name__}: {visible(message_of(error))}{place}; report it to its authors"
        ) from error


def _is_on_purpose(error: BaseException) -> bool:
    return isinstance(error, GridslamError) and type(error) is not GridslamError


def _is_usable(estimate: object) -> bool:
    return (
        isinstance(estimate, Estimate)
        and isinstance(estimate.stamp_ns, Integral)
        and np.shape(estimate.pose) == (3,)
        and (estimate.particles is None or np.shape(estimate.particles)[1:] == (3,))
        and all(_are_poses(p) for p in (estimate.pose, estimate.particles) if p is not None)
    )


def _are_poses(poses: object) -> bool:
    """Whether all numbers are those of poses; NaN is none."""
    return bool((np.abs(np.asarray(poses, np.float64)) <= MAX_COORDINATE_M).all())


class PackagedMethod:
    """A method of a package, whose errors name it."""

    def __init__(self, method: Method, package: str) -> None:
        self._method = method
        self._package = package

    @property
    def estimate(self) -> Estimate | None:
        """That of the wrapped method."""
        with naming(self._package):
            estimate = self._method.estimate
            if estimate is not None and not _is_usable(estimate):
                raise TypeError("the estimate has no stamp, or poses that are not finite numbers (n, 3)")
            return estimate

    def process(self, event: Event) -> None:
        """Let the method process the event."""
        with naming(self._package):
            self._method.process(event)

    def result(self) -> RunResult:
        """That of the wrapped method."""
        with naming(self._package):
            return self._method.result()
