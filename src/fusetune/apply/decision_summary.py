"""A decision in a sentence, with the parameters that change and the next step: what a terminal has room for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.apply.ranking import improvement_percent
from fusetune.apply.wording import counted


@dataclass(frozen=True)
class DecisionSummary:
    """What is told first of a decision.

    Attributes
    ----------
    status : `change`, `keep` or `no_evidence`
    sentence : the decision, with its size and how sure it is
    parameters : name → value before and value after, by the names of the vehicle's own release
    can_be_loaded : whether the parameter files hold them
    next_step : what to do now; empty where nothing is proposed
    """

    status: str
    chosen: str
    is_exploratory: bool
    sentence: str
    parameters: dict[str, tuple[float, float]]
    can_be_loaded: bool
    next_step: str

    def lines(self) -> Iterator[str]:
        """The sentence, and below it each parameter with its values."""
        yield self.sentence
        for name, (before, after) in self.parameters.items():
            yield f"  {name}  {before:.6g} → {after:.6g}"

    def document(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "decision": self.status,
            "chosen": self.chosen,
            "exploratory": self.is_exploratory,
            "sentence": self.sentence,
            "parameters": [
                {"name": name, "previous": before, "value": after} for name, (before, after) in self.parameters.items()
            ],
            "can_be_loaded": self.can_be_loaded,
            "next_step": self.next_step,
        }


def decision_summary(decision: Mapping[str, Any]) -> DecisionSummary:
    """The summary of what `decision.json` holds, also of one that another release wrote."""
    on_vehicle = decision.get("on_vehicle") or {}
    refused = on_vehicle.get("refused") or ()
    written = on_vehicle.get("parameters") or decision.get("changes", ())
    changes = {one["name"]: (float(one["previous"]), float(one["value"])) for one in written}
    steps = decision.get("next_steps") or ({"text": ""},)
    exploratory = bool(decision.get("exploratory"))
    sentence = _sentence(decision, len(changes))
    if exploratory and decision["status"] != "no_evidence":
        sentence += f" Exploratory: {counted(decision['flights_scored'], 'flight')} cannot speak for the next one."
    if refused:
        sentence += f" But nothing of it can be loaded: {refused[0]['name']}: {refused[0]['reason']}."
    return DecisionSummary(
        status=decision["status"],
        chosen=decision["chosen"],
        is_exploratory=exploratory,
        sentence=sentence,
        parameters=changes,
        can_be_loaded=bool(changes) and not refused,
        next_step=str(steps[0]["text"]),
    )


def _sentence(decision: Mapping[str, Any], changes: int) -> str:
    ranking = {one["name"]: one for one in decision["ranking"]}
    if decision["status"] == "change":
        one = ranking[decision["chosen"]]
        return f"Change {counted(changes, 'parameter')} (set “{one['name']}”): {_size(one, decision)}."
    if decision["status"] == "no_evidence":
        return "No decision: no flight has a say."
    best = ranking.get(decision["best_candidate"] or "")
    others = sum(not one["is_present"] for one in ranking.values())
    if best is None or not others:
        return "Keep the parameters that fly now: there is no other set to choose."
    return (
        f"Keep the parameters that fly now: of {counted(others, 'other set')} the nearest, “{best['name']}”, has "
        f"{_size(best, decision)}."
    )


def _size(one: Mapping[str, Any], decision: Mapping[str, Any]) -> str:
    gain = float(one["improvement_percent"])
    size = f"prediction errors {abs(gain):.1f} % {'smaller' if gain >= 0.0 else 'larger'}"
    wins = f"better on {one['flights_better']} of {counted(one['flights'], 'flight')}"
    if one["lower"] is None or one["upper"] is None:
        return f"{size}, {wins}"
    ends = sorted(-improvement_percent(one[end]) for end in ("lower", "upper"))
    confidence = float(decision["rule"]["confidence"])
    span = f"{confidence:.0%} interval of the change {ends[0]:+.1f} to {ends[1]:+.1f} %".replace("-", "−")
    return f"{size} ({span}), {wins}"
