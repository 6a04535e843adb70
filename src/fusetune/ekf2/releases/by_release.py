"""Kernels that differ by release: which one a call means follows from the type of a record, while Numba compiles.

The records of v1.16 are plain. Those of another release have one field more, named after the release, in second place:
Numba takes a record that only goes on longer for one of the shorter type. So their type is another, Numba
compiles anew for it, and what `by_release` chooses between is settled by then: nothing is asked at run time, and what
is not chosen is neither typed nor compiled. v1.16 compiles as if there were no others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numba.core import types
from numba.core.imputils import lower_constant
from numba.extending import models, register_model, typeof_impl

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.releases.behaviours import BASELINE, BEHAVIOURS, RELEASES, Behaviours

CACHE_LINE_BYTES = 64

Kernel = Any
"""A compiled function, or a choice between some."""

_MARKS = {release: f"of_{release.replace('.', '_')}" for release in RELEASES if release != BASELINE}


def marked(record: np.dtype, release: str) -> np.dtype:
    """The dtype of a record in a release: that of v1.16 itself, those of others with a field that tells them apart.

    That is as long as a line of the cache, so that the fields behind it lie as they do in v1.16's.
    """
    if release == BASELINE:
        return record
    assert record.fields is not None, "only records are marked"
    first, *others = [(name, record.fields[name][0]) for name in record.names or ()]
    return np.dtype([first, (_MARKS[release], "u1", (CACHE_LINE_BYTES,)), *others], align=True)


def release_of_fields(names: Iterable[str]) -> str:
    """The release whose record has fields of these names."""
    known = frozenset(names)
    return next((release for release, mark in _MARKS.items() if mark in known), BASELINE)


class KernelChoice:
    """Stands for one of two kernels: in compiled code for the one of the release that is compiled for."""

    def __init__(self, plain: Kernel, behaviour: str, other: Kernel) -> None:
        assert behaviour in Behaviours.__dataclass_fields__
        self.plain, self.behaviour, self.other = plain, behaviour, other
        self.__doc__ = plain.__doc__

    def of(self, release: str) -> Kernel:
        """The kernel of a release."""
        chosen = self.other if getattr(BEHAVIOURS[release], self.behaviour) else self.plain
        return chosen.of(release) if isinstance(chosen, KernelChoice) else chosen

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python: the kernel of the release whose record is given."""
        dtypes = [argument.dtype for argument in arguments if isinstance(argument, np.void | np.ndarray)]
        return self.of(release_of_fields(name for dtype in dtypes for name in dtype.names or ()))(*arguments)


def by_release(plain: Kernel, behaviour: str, other: Kernel) -> KernelChoice:
    """A kernel that is `plain`, that of v1.16, but in releases with a behaviour is `other`.

    Parameters
    ----------
    plain, other : take the same arguments, among them the record `ekf` or another one that is marked with the release;
        either may be a choice itself
    behaviour : a field of `Behaviours`
    """
    return KernelChoice(plain, behaviour, other)


@kernel
def _never(ekf):
    return False


@kernel
def _always(ekf):
    return True


def does(behaviour: str) -> Callable[[Any], bool]:
    """A question to the record `ekf`, answered while it is compiled: whether its release has a behaviour."""
    return by_release(_never, behaviour, _always)


class _ChoiceType(types.Callable, types.Opaque):  # type: ignore[misc]
    """Type of a choice: a call has the type, and the code, of the same call of the kernel that is chosen."""

    def __init__(self, choice: KernelChoice) -> None:
        self.choice = choice
        super().__init__(f"KernelChoice({choice.behaviour}, {id(choice)})")

    def _chosen(self, arguments: Iterable[Any]) -> types.Dispatcher:
        records = (one for one in arguments if isinstance(one, types.Record))
        release = release_of_fields(name for record in records for name in record.fields)
        return types.Dispatcher(self.choice.of(release))

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        return self._chosen(args).get_call_type(context, args, kws)

    def get_call_signatures(self) -> tuple[tuple[()], bool]:
        return (), True

    def get_impl_key(self, sig: Any) -> Any:
        return self._chosen(sig.args).get_impl_key(sig)


register_model(_ChoiceType)(models.OpaqueModel)


@typeof_impl.register(KernelChoice)
def _type_of_choice(choice: KernelChoice, _: Any) -> _ChoiceType:
    return _ChoiceType(choice)


@lower_constant(_ChoiceType)
def _nothing_to_hold(context: Any, builder: Any, of_type: Any, choice: KernelChoice) -> Any:
    return context.get_dummy_value()
