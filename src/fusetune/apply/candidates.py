"""Sets that the evidence asks for and that were not among those compared: candidates for the next study.

Where a set that was ruled out predicts much better than the present one, what it gains and what rules it out may be
had apart: its noise with wider gates, or values between its own and the present ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import yaml

from fusetune.design.names import one_line
from fusetune.design.parameter_check import parameter_problem, typed_values
from fusetune.px4.aid_sources import MEASURED_SOURCES
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS
from fusetune.storage.files import AnyPath, atomic_path

_SIGNIFICANT_DIGITS = 3
"""Of proposed values: no flight tells more."""

LONGEST_CANDIDATE_NAME = 64
"""As many characters as the design room takes in the name of a listed set."""

_WIDEST = 4.0
"""No gate is made wider than so many times what it was: beyond, it holds nothing back."""


@dataclass(frozen=True)
class Candidate:
    """A parameter set to compare in the next study.

    Attributes
    ----------
    name : of the set, as the design room takes it
    overrides : parameters in which it differs from what flies now, name → value
    reason : why it is proposed, in a sentence for people
    """

    name: str
    overrides: dict[str, float]
    reason: str


def between_vetoed_and_present(
    better: Mapping[str, Sequence[str]], sets: Mapping[str, Mapping[str, float]], present: Mapping[str, float]
) -> list[Candidate]:
    """Candidates for all sets that are ruled out and predict better, none of them a set that was compared.

    Parameters
    ----------
    better : name of each such set → what rules it out
    sets : overrides of all sets that were compared
    present : all parameters of the present set
    """
    found = [one for name, why in better.items() for one in candidates_of_vetoed(name, sets[name], present, why)]
    return without_twins(found, sets)


def candidates_sentence(candidates: Sequence[Candidate], vetoed: Mapping[str, float]) -> str:
    """What a reader of the decision is told of them; empty where nothing is proposed.

    Parameters
    ----------
    vetoed : name of each set that is ruled out and predicts better → by how many percent its errors are smaller
    """
    sentences = []
    if vetoed:
        sets = ", ".join(f"“{name}” (errors {percent:.1f} % smaller)" for name, percent in vetoed.items())
        sentences.append(f"Ruled out, though better than now beyond doubt by its predictions: {sets}.")
    if candidates:
        ways = "; ".join(f"{one.name} ({_values(one)})" for one in candidates)
        sentences.append(f"Worth comparing next, and ready as a study in candidates.yaml: {ways}.")
    return " ".join(sentences)


def _values(candidate: Candidate) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in candidate.overrides.items())


def candidates_of_vetoed(
    name: str, overrides: Mapping[str, float], present: Mapping[str, float], why: Sequence[str]
) -> list[Candidate]:
    """What lies between the present set and one that predicts better but is ruled out.

    Parameters
    ----------
    name, overrides : of the set that is ruled out
    present : all parameters of the present set
    why : what rules it out, in words

    Returns
    -------
    The set with wider gates, where it lowers the noise of a gated source: each gate grows by the ratio of the noises,
    so that as large an error passes as before. And the set halfway, every value the geometric mean of its own and the
    present one; switches and values that have no such mean stay as they are in the set that is ruled out.
    """
    because = f"“{name}” predicts better than now, but is ruled out ({'; '.join(why)})" if why else f"“{name}”"
    found = []
    gates = _wider_gates(overrides, present)
    if gates:
        told = ", ".join(f"{gate} {value:g}" for gate, value in gates.items())
        found.append(_candidate(f"{name}_wider_gates", {**overrides, **gates}, f"{because}: its noise, with {told}"))
    between = {one: _between(one, value, present.get(one, value)) for one, value in overrides.items()}
    if any(between[one] not in (overrides[one], present.get(one)) for one in between):
        found.append(_candidate(f"{name}_halfway", between, f"{because}: halfway between it and what flies now"))
    return [one for one in found if not _problems(one)]


def _candidate(name: str, overrides: Mapping[str, float], reason: str) -> Candidate:
    return Candidate(name[-LONGEST_CANDIDATE_NAME:].lstrip("_-"), dict(sorted(overrides.items())), one_line(reason))


def _problems(candidate: Candidate) -> list[str]:
    """What the design room would not take; nothing is proposed that it would refuse."""
    problems = (parameter_problem(name, value) for name, value in candidate.overrides.items())
    return [problem for problem in problems if problem]


def _between(parameter: str, value: float, present: float) -> float:
    """Geometric mean; the value itself where there is none."""
    if value > 0.0 and present > 0.0 and value != present and ALL_PARAMETERS[parameter].type == "FLOAT":
        return rounded(math.sqrt(value * present))
    return value


def _wider_gates(overrides: Mapping[str, float], present: Mapping[str, float]) -> dict[str, float]:
    gates: dict[str, float] = {}
    for source in MEASURED_SOURCES.values():
        gate = source.gate_parameter
        if gate is None or gate not in present or gate in overrides:
            continue
        noises = [one for one in source.noises if one in present]
        ratios = [present[one] / overrides[one] for one in noises if overrides.get(one, 0.0) > 0.0]
        wider = min(max(ratios, default=1.0), _WIDEST)
        if wider > 1.0:
            gates[gate] = max(gates.get(gate, 0.0), rounded(present[gate] * wider))
    return gates


def rounded(value: float) -> float:
    """A value to propose: to three significant digits."""
    return float(f"{value:.{_SIGNIFICANT_DIGITS}g}")


def without_twins(candidates: Iterable[Candidate], taken: Mapping[str, Mapping[str, float]]) -> list[Candidate]:
    """Candidates under names of their own, without those that are as one before or as a set that was compared.

    Parameters
    ----------
    taken : the sets that were compared, name → overrides
    """
    names = {name.casefold() for name in taken}
    known = [dict(one) for one in taken.values()]
    kept = []
    for one in candidates:
        if not one.overrides or one.overrides in known:
            continue
        name, number = one.name, 2
        while name.casefold() in names:
            name, number = f"{one.name[: LONGEST_CANDIDATE_NAME - 4]}_{number}", number + 1
        names.add(name.casefold())
        known.append(one.overrides)
        kept.append(Candidate(name, one.overrides, one.reason))
    return kept


def write_candidates(path: AnyPath, candidates: Sequence[Candidate]) -> None:
    """Write a study of the candidates, which `study:` in the configuration may name.

    Without any the file says so, and is no study.
    """
    sets = [
        {"name": one.name, "description": one.reason, "parameters": typed_values(one.overrides)} for one in candidates
    ]
    document = {
        "name": "candidates",
        "description": "Sets that the last decision proposes to compare next.",
        "kind": "list",
        "sets": sets,
    }
    head = (
        "# Sets that the decision proposes to compare next: copy this file to config/studies/, name it in `study:`.\n"
        if candidates
        else "# The decision proposes no sets to compare next; this file is no study until it holds some.\n"
    )
    with atomic_path(path) as temporary:
        text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=120)
        temporary.write_text(head + text, encoding="utf-8")
