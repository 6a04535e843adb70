"""Which kernel a call means follows from the type of the record, and leaves nothing in the machine code."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from numba.core import config
from numba.np.numpy_support import from_dtype

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.parameters import PARAMETER_NAMES, complete, parameter_record
from fusetune.ekf2.filter.estimator import EKF, ekf_record
from fusetune.ekf2.releases.behaviours import BASELINE, BEHAVIOURS, MODELLED, RELEASES
from fusetune.ekf2.releases.by_release import by_release, does, marked, release_of_fields
from fusetune.ekf2.releases.modelled import demand_modelled
from fusetune.errors import UserError

PLAIN = np.dtype([("value", "f8")])
NEW = "v1.17"
BEHAVIOUR = "correlates_wind_always"
"""Any one that v1.17 has."""


@kernel
def _plus(record):
    return record.value + 1.0


@kernel
def _minus(record):
    # a field that only the record of the newer release has: the kernel of the older one must not be typed with it
    return record.value - 1.0 if record.of_v1_17[0] else record.value - 2.0


_changed = by_release(_plus, BEHAVIOUR, _minus)
_nested = by_release(_changed, "simplifies_gnss_checks", _plus)
_asks = does(BEHAVIOUR)


@kernel
def _through_choice(records):
    return _changed(records[0])


@kernel
def _by_question(records):
    if _asks(records[0]):
        return records[0].value * 3.0
    return records[0].value * 5.0


def test_the_record_of_the_baseline_has_no_new_field():
    assert ekf_record(BASELINE) is EKF
    assert marked(PLAIN, BASELINE) is PLAIN
    assert parameter_record(complete({}, {}, None)).dtype.names == PARAMETER_NAMES
    for release in RELEASES:
        assert release_of_fields(ekf_record(release).names or ()) == release


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="Numba is switched off")
def test_no_record_passes_for_that_of_another_release():
    types = [from_dtype(ekf_record(release)) for release in RELEASES]
    for one, other in permutations(types, 2):
        assert one.can_convert_to(None, other) is None


def test_python_and_compiled_code_choose_the_kernel_of_the_record():
    old, new = (np.zeros(1, marked(PLAIN, release)) for release in (BASELINE, NEW))
    old["value"] = new["value"] = 7.0
    assert _through_choice(old) == 8.0
    assert _through_choice(new) == 5.0
    assert (_by_question(old), _by_question(new)) == (35.0, 21.0)
    assert (_changed(old[0]), _changed(new[0])) == (8.0, 5.0)


def test_choices_nest():
    assert _nested.of(BASELINE) is _plus
    assert _nested.of(NEW) is _plus
    assert by_release(_minus, BEHAVIOUR, _changed).of(NEW) is _minus


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="Numba is switched off")
def test_what_is_not_chosen_is_not_compiled():
    @kernel
    def never_typed(record):
        return record.nothing_has_this_field

    choice = by_release(_plus, BEHAVIOUR, never_typed)

    @kernel
    def calls(records):
        return choice(records[0])

    assert calls(np.zeros(1, PLAIN)) == 1.0
    assert not never_typed.signatures


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="Numba is switched off")
def test_a_question_leaves_no_branch():
    """Of the two products one is left in the code, and no jump decides between them."""
    for release, factor in ((BASELINE, "5.0"), (NEW, "3.0")):
        records = np.zeros(1, marked(PLAIN, release))
        _by_question(records)
        code = _by_question.inspect_llvm(_by_question.signatures[-1])
        body = code[code.index("define") :].split("\n}", 1)[0]
        assert body.count("fmul") == 1, factor
        assert "br i1" not in body


def test_the_baseline_does_nothing_otherwise():
    assert not any(vars(BEHAVIOURS[BASELINE]).values())
    assert BASELINE in MODELLED


@pytest.mark.parametrize("release", sorted({*RELEASES, "v1.99"} - {*MODELLED}))
def test_a_release_that_is_not_modelled_is_refused_by_name(release):
    with pytest.raises(UserError, match=rf"{release}: is no release .* can be replayed yet. Choose .*v1\.16"):
        demand_modelled(release)
