"""Decides over all flights and writes the ranking, the decision and the parameter files."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fusetune.analyze.delays.wrong_delays import read_joined
from fusetune.analyze.effects.joined_effects import read_joined_effects
from fusetune.apply.by_manoeuvre import by_manoeuvre, only_classes_sentences
from fusetune.apply.candidates import (
    Candidate,
    between_vetoed_and_present,
    candidates_sentence,
    without_twins,
    write_candidates,
)
from fusetune.apply.cautions import cautions
from fusetune.apply.choice import Choice, choose, choose_after_mending, parameter_distance
from fusetune.apply.consistency import (
    SourceNoise,
    consistency_candidates,
    consistency_findings,
    sentence_of_largest,
    source_noises,
)
from fusetune.apply.criteria import Criteria, criteria, metrics_of, paper_entries
from fusetune.apply.delays import confirmed, delay_findings, delay_sentences
from fusetune.apply.effect_findings import effect_findings
from fusetune.apply.evidence import AIMS, AnalyzedFlight, read_flights, read_left_out, white_shares
from fusetune.apply.flight_problems import problem_findings, problem_sentence, read_diagnoses
from fusetune.apply.missing_motion import missing_motion
from fusetune.apply.next_steps import Situation, next_steps, refused_remedies, steps_sentence
from fusetune.apply.one_vehicle import decided_vehicle, source_of_present, unsure_of_present
from fusetune.apply.paper_disagreement import is_same_set, why
from fusetune.apply.paper_mode import PaperEntry, paper_ranking
from fusetune.apply.parameter_changes import ParameterChange, parameter_changes
from fusetune.apply.parameter_files.vehicle_changes import vehicle_changes
from fusetune.apply.parameter_files.vehicle_parameters import VehicleParameters, of_replayed, vehicle_parameters
from fusetune.apply.parameter_files.write_files import FilesOrigin, write_parameter_files
from fusetune.apply.pieces_evidence import in_classes, read_flight_pieces
from fusetune.apply.power.power import Power, power_of
from fusetune.apply.power.spread import spread_of
from fusetune.apply.provenance import file_hash, flight_rows, provenance
from fusetune.apply.ranking import RankedSet, rank
from fusetune.apply.ranking_sheet import sheet_of_ranking
from fusetune.apply.recommended import Recommended
from fusetune.apply.rounded import rounded
from fusetune.apply.sensitivity.files import SENSITIVITY_FILE, write_sensitivity
from fusetune.apply.sensitivity.result import Sensitivity
from fusetune.apply.sensitivity.sensitivity import sensitivity
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.study_trials import trials_of_study
from fusetune.apply.vetoes import break_rates, vetoes
from fusetune.apply.wording import named, paragraph, smaller
from fusetune.errors import UserError
from fusetune.finding import documents
from fusetune.set_names import DELAY_MENDED, PRESENT, is_mended
from fusetune.storage.csv_file import write_csv
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import read_table, write_table


def decide(
    analyze_folders: Sequence[AnyPath],
    flights_table: AnyPath,
    output_folder: AnyPath,
    *,
    sets: Sequence[str],
    present: str = PRESENT,
    newest_flight: str | None = None,
    same_present: Sequence[str] = (),
    descriptions: Mapping[str, str] | None = None,
    configuration_files: Sequence[AnyPath] = (),
    delays: AnyPath | None = None,
    effects: AnyPath | None = None,
    diagnoses: Sequence[AnyPath] = (),
    legs: AnyPath | None = None,
    recommended: Recommended | None = None,
    saved: AnyPath | None = None,
    settings: DecisionSettings | None = None,
) -> None:
    """Rank all sets over all flights, decide, and write `ranking.parquet`, `ranking.csv`, `per_flight.parquet`,
    `decision.json`, `candidates.yaml`, `sensitivity.json` and the parameter files (`parameter_files.names`) to
    `output_folder`.

    Parameters
    ----------
    analyze_folders : `results/analyze/<flight>` of every replayed flight, in any order; may be empty
    flights_table : `results/save/flights.parquet`, with the refused logs too
    sets : all sets, the present one among them or added
    present : the configuration that the vehicle flies now, replayed on every flight like any other set. Its
        parameters on the newest flight are the "previous values". Given with explicit values it is one
        configuration on all flights; with none it is each flight's own.
    newest_flight : by whose log the vehicle's present parameters are known; the last by name if None. Its vehicle is
        decided for, flights of others are left out.
    same_present : flights that have the same values, the newest first; one that counts stands for it where it does not
    descriptions : a line about each set, from the study
    configuration_files : hashed into the decision
    delays : `results/analyze/delays.json`, what the sensors' delays are; None where they were not estimated
    effects : `results/analyze/effects.json`, what flights tell of single effects; None where they were not estimated
    diagnoses : `results/analyze/<flight>/diagnosis.json` of the flights
    legs : `results/analyze/legs.parquet`, the scores by manoeuvre and leg; None where flights were not split
    recommended : what one of the sets stands for, where that is a search's
    saved : folder of the saved flights, `results/save`, for all that the vehicle has; None where there are only the
        parameters that were replayed

    Raises
    ------
    UserError
        If the newest flight is none of the flights, or a configuration file cannot be read.
    """
    settings = settings or DecisionSettings()
    sets = list(dict.fromkeys((present, *sets)))
    folders = [Path(folder) for folder in analyze_folders]
    newest_flight = newest_flight or max((folder.name for folder in folders), default=None)
    vehicle = decided_vehicle(flights_table, [folder.name for folder in folders], newest_flight)
    seen_by = DELAY_MENDED if recommended is None else recommended.name
    flights = read_flights([one for one in folders if one.name not in vehicle.others], settings, present, seen_by)
    pieces = read_flight_pieces(legs) if legs is not None else {}
    parts = by_manoeuvre([one.evidence for one in flights if one.evidence], pieces, sets, present, settings)
    if settings.only_classes:
        flights = [in_classes(one, pieces, present, settings) for one in flights]
    others = [read_left_out(one, why) for one in folders if (why := vehicle.without(one.name))]
    newest = source_of_present(flights, _newest(flights, newest_flight, flights_table), same_present)
    metrics = metrics_of(flights)
    ranked, choice = _ranked_and_chosen(sets, present, flights, metrics, newest, settings, recommended)
    if DELAY_MENDED in sets:
        mended = [name for name in sets if is_mended(name)]
        able = [one for one in flights if one.evidence is None or DELAY_MENDED in one.evidence.sets]
        _, among_mended = _ranked_and_chosen(mended, DELAY_MENDED, able, metrics, newest, settings)
        choice = choose_after_mending(choice, ranked, among_mended)
    values = criteria(sets, settings.main_source, flights, metrics)
    changes = _changes(choice, newest, present, recommended)
    has = _vehicle_parameters(newest, present, saved)
    on_vehicle = vehicle_changes(changes, has)
    noises = _noises(flights, metrics, newest, present, settings)
    findings = consistency_findings(noises, settings)
    better = _vetoed_but_better(ranked)
    told = read_joined_effects(effects) if effects is not None else None
    problems = problem_findings([one for one in map(read_diagnoses, diagnoses) if vehicle.without(one.flight) is None])
    changed = [one.name for one in changes]
    measured = effect_findings(told, choice, ranked, changed, settings) if told is not None else ()
    late = confirmed(delay_findings(read_joined(delays) if delays is not None else ()), choice, ranked)
    proposed = _candidates(better, newest, present, consistency_candidates(noises, settings))
    minded = cautions(choice.pick, changes, _whiteness(metrics, flights, present), settings) if choice.pick else ()
    told_of_vehicle = on_vehicle.sentence()
    minded = (*minded, told_of_vehicle) if told_of_vehicle else minded
    power = _power(ranked, present, flights, settings)
    missing = missing_motion(flights, present, read_joined(delays) if delays is not None else (), told)
    steps = next_steps(
        Situation(
            choice,
            ranked,
            flights,
            changes,
            proposed,
            late,
            missing,
            power,
            _changed_parameters(newest, present),
            refused_remedies(read_table(flights_table).to_pylist()),
            on_vehicle.refused,
            is_simulated=vehicle.identity is not None and not vehicle.identity.is_real,
        ),
        settings,
    )
    sentences = (
        problem_sentence(problems),
        delay_sentences(late),
        paragraph(choice, ranked, flights, settings),
        *only_classes_sentences(settings),
        *minded,
        sentence_of_largest(findings),
        candidates_sentence(proposed, _gains(better)),
        *vehicle.sentences(),
        *unsure_of_present(flights, newest),
        steps_sentence(steps),
    )
    text = " ".join(filter(None, sentences))
    figures = [_figures_of(one) for one in ranked]
    decision = _decision(choice, figures, flights, newest, changes, text, settings)
    decision["paragraphs"] = [one for one in sentences if one]
    decision["next_steps"] = [asdict(one) for one in steps]
    decision["missing_motion"] = [asdict(one) for one in missing]
    decision["power"] = None if power is None else power.document()
    decision["cautions"] = list(minded)
    decision["by_manoeuvre"] = [dict(vars(one)) for one in parts]
    decision["candidates"] = [asdict(one) for one in proposed]
    decision["present"] = present
    decision["findings"] = documents((*problems, *late, *measured, *findings))
    decision["noises"] = [asdict(one) for one in noises]
    decision["provenance"] = provenance(configuration_files)
    decision["vehicle"] = vehicle.document(flights, newest.name if newest else None)
    decision["flights"] = flight_rows(flights_table, [*flights, *others])
    decision["sets"] = _sets(sets, present, newest, descriptions or {}, flights)
    decision["paper_mode"] = _paper_mode(
        paper_entries(sets, flights, metrics, values), choice, ranked, flights, metrics, settings
    )

    output = Path(output_folder)
    _write_ranking(output, ranked, figures, values, settings.main_source)
    _write_per_flight(output, flights)
    write_candidates(output / "candidates.yaml", proposed)
    write_sensitivity(output / SENSITIVITY_FILE, _sensitivity(flights, newest, present, choice, ranked, settings))
    decision["on_vehicle"] = on_vehicle.document() | {"judged": has.judged}
    origin = _files_origin(choice, decision, newest, has, settings)
    written = write_parameter_files(output, on_vehicle, has, origin)
    decision["parameter_files"] = {file.name: file_hash(file) for file in written}
    with atomic_path(output / "decision.json") as temporary:
        write_document(temporary, rounded(decision), allow_nan=False)


def _ranked_and_chosen(
    sets: Sequence[str],
    present: str,
    flights: Sequence[AnalyzedFlight],
    metrics: pa.Table,
    newest: AnalyzedFlight | None,
    settings: DecisionSettings,
    recommended: Recommended | None = None,
) -> tuple[list[RankedSet], Choice]:
    """Sets against one of them, and what is chosen among them."""
    rates = break_rates(metrics)
    vetoed = {name: vetoes(name, present, flights, rates, settings) for name in sets if name != present}
    if recommended is not None and recommended.name in vetoed:
        vetoed[recommended.name] += recommended.objections
    ranked = rank(sets, present, flights, {name: why for name, why in vetoed.items() if why}, settings)
    evidence = [flight.evidence for flight in flights if flight.evidence is not None]
    return ranked, choose(ranked, present, evidence, _distances(newest, present), settings)


def _whiteness(metrics: pa.Table, flights: Sequence[AnalyzedFlight], present: str) -> dict[str, float]:
    """How white the error of each source is, the mean over the flights that count."""
    counted = pa.array([flight.name for flight in flights if flight.evidence is not None], pa.string())
    return white_shares(metrics.filter(pc.is_in(metrics["flight"], value_set=counted)), present)


def _power(
    ranked: Sequence[RankedSet], present: str, flights: Sequence[AnalyzedFlight], settings: DecisionSettings
) -> Power | None:
    """How many flights a gain takes, from the sets that nothing but their score speaks against."""
    counted = [one for one in flights if one.evidence is not None]
    evidence = [one.evidence for one in counted if one.evidence is not None]
    sets = [one.name for one in ranked if one.flights == len(evidence) and not (one.is_present or one.is_vetoed)]
    minutes = sum(one.summary["scored_s"] for one in counted) / 60.0 / max(len(counted), 1)
    return power_of(spread_of(evidence, [present, *sorted(sets)]), minutes, settings)


def _changed_parameters(newest: AnalyzedFlight | None, present: str) -> dict[str, list[str]]:
    """Of each set the parameters that it gives another value than the vehicle has."""
    sets = newest.summary["sets"] if newest is not None else {}
    now = sets.get(present, {}).get("parameters", {})
    return {
        name: sorted(key for key, value in one["overrides"].items() if value != now.get(key))
        for name, one in sets.items()
    }


def _newest(flights: Sequence[AnalyzedFlight], name: str | None, flights_table: AnyPath) -> AnalyzedFlight | None:
    if name is None:
        return None
    for flight in flights:
        if flight.name == name:
            return flight
    raise UserError(flights_table, f"the newest flight {name!r} was not replayed", "Name one of the replayed flights")


def _distances(newest: AnalyzedFlight | None, present: str) -> dict[str, float]:
    sets = newest.summary["sets"] if newest is not None else {}
    now = sets.get(present, {}).get("parameters", {})
    return {name: parameter_distance(one["overrides"], now) for name, one in sets.items()}


def _noises(
    flights: Sequence[AnalyzedFlight],
    metrics: pa.Table,
    newest: AnalyzedFlight | None,
    present: str,
    settings: DecisionSettings,
) -> list[SourceNoise]:
    """What PX4 is told of the sources, and what the flights that decide say of them."""
    deciding = pa.array([flight.name for flight in flights if flight.evidence is not None], pa.string())
    parameters = newest.summary["sets"].get(present, {}).get("parameters", {}) if newest is not None else {}
    return source_noises(metrics.filter(pc.is_in(metrics["flight"], deciding)), present, parameters, settings)


def _sensitivity(
    flights: Sequence[AnalyzedFlight],
    newest: AnalyzedFlight | None,
    present: str,
    choice: Choice,
    ranked: Sequence[RankedSet],
    settings: DecisionSettings,
) -> Sensitivity | None:
    """What the sets tell of the parameters, around the set that is chosen."""
    trials = trials_of_study(flights, newest, present, [one.name for one in ranked if one.is_vetoed])
    if trials is None:
        return None
    incumbent = trials.values[trials.names.index(choice.chosen)] if choice.chosen in trials.names else None
    return sensitivity(trials, incumbent, confidence=settings.confidence, seed=settings.seed)


def _vetoed_but_better(ranked: Sequence[RankedSet]) -> list[RankedSet]:
    """Sets that are ruled out though they predict better than the present one beyond doubt."""
    return [one for one in ranked if one.is_vetoed and one.upper is not None and one.upper < 0.0]


def _candidates(
    better: Sequence[RankedSet], newest: AnalyzedFlight | None, present: str, found: Sequence[Candidate]
) -> list[Candidate]:
    """What to compare next: what lies between such sets and the present one, and what was found beside."""
    if newest is None:
        return []
    sets = {name: one["overrides"] for name, one in newest.summary["sets"].items()}
    now = newest.summary["sets"].get(present, {}).get("parameters", {})
    between = between_vetoed_and_present({one.name: one.reasons for one in better if one.name in sets}, sets, now)
    return without_twins([*between, *found], sets)


def _gains(better: Sequence[RankedSet]) -> dict[str, float]:
    return {one.name: one.improvement_percent for one in better}


def _changes(
    choice: Choice, newest: AnalyzedFlight | None, present: str, recommended: Recommended | None
) -> tuple[ParameterChange, ...]:
    if choice.status != "change" or newest is None:
        return ()
    sets = newest.summary["sets"]
    now = sets[present]["parameters"]
    if recommended is not None and choice.chosen == recommended.name:
        return parameter_changes(recommended.values, now, recommended.alone)
    return parameter_changes(sets[choice.chosen]["overrides"], now)


def _decision(
    choice: Choice,
    figures: Sequence[dict[str, Any]],
    flights: Sequence[AnalyzedFlight],
    newest: AnalyzedFlight | None,
    changes: Sequence[ParameterChange],
    text: str,
    settings: DecisionSettings,
) -> dict[str, Any]:
    return {
        "status": choice.status,
        "chosen": choice.chosen,
        "best_candidate": choice.best.name if choice.best else None,
        "exploratory": choice.exploratory,
        "paragraph": text,
        "flights_scored": sum(flight.evidence is not None for flight in flights),
        "newest_flight": newest.name if newest else None,
        "changes": [asdict(change) for change in changes],
        "rule": asdict(settings) | {"main_source": settings.main_source},
        "leave_one_out": asdict(choice.leave_one_out) if choice.leave_one_out else None,
        "weights": _weights(flights),
        "ranking": list(figures),
    }


def _figures_of(one: RankedSet) -> dict[str, Any]:
    """All that the ranking says of a set, its part in the decision first."""
    return {"name": one.name, "status": one.status, **asdict(one)}


def _weights(flights: Sequence[AnalyzedFlight]) -> dict[str, dict[str, float]]:
    """Weight of every kind of prediction on every flight."""
    return {
        flight.name: {aim.name: aim.weight for aim in flight.evidence.aims}
        for flight in flights
        if flight.evidence is not None
    }


def _sets(
    sets: Sequence[str],
    present: str,
    newest: AnalyzedFlight | None,
    descriptions: Mapping[str, str],
    flights: Sequence[AnalyzedFlight],
) -> list[dict[str, Any]]:
    rows = []
    for name in sets:
        summary = newest.summary["sets"].get(name, {}) if newest else {}
        inactive = {f.name: why for f in flights if (why := f.summary["sets"].get(name, {}).get("inactive"))}
        rows.append(
            {
                "set": name,
                "description": descriptions.get(name, "the configuration that flies now" if name == present else ""),
                "overrides": summary.get("overrides", {}),
                "inactive": inactive,
            }
        )
    return rows


def _paper_mode(
    entries: Sequence[PaperEntry],
    choice: Choice,
    ranked: Sequence[RankedSet],
    flights: Sequence[AnalyzedFlight],
    metrics: pa.Table,
    settings: DecisionSettings,
) -> dict[str, Any]:
    order = paper_ranking(entries)
    first = order[0].name if order and not math.isnan(order[0].aggregate_rms) else None
    return {
        "rule": "lowest RMS of the GNSS position, height and velocity innovations together, inside the χ² bounds",
        "first": first,
        "agrees": is_same_set(first, choice.chosen, ranked) if first is not None else None,
        "why": why(first, order, choice.chosen, ranked, flights, metrics, settings) if first is not None else [],
        "ranking": [asdict(entry) for entry in order],
    }


def _write_ranking(
    folder: Path,
    ranked: Sequence[RankedSet],
    figures: Sequence[dict[str, Any]],
    values: dict[str, Criteria],
    source: str,
) -> None:
    rows = []
    for position, (one, own) in enumerate(zip(ranked, figures, strict=True), start=1):
        row: dict[str, Any] = {"rank": position, **own, **_flat_aims(one), **values[one.name]}
        del row["aims"], row["is_present"]
        row["reasons"] = "; ".join(one.reasons)
        row["worse_aims"] = " ".join(one.worse_aims)
        rows.append(rounded(row))
    table = pa.Table.from_pylist(rows)
    # A column in which nothing is known is one of figures all the same.
    schema = [pa.field(one.name, pa.float64()) if pa.types.is_null(one.type) else one for one in table.schema]
    table = table.cast(pa.schema(schema))
    with atomic_path(folder / "ranking.parquet") as temporary:
        write_table(table, temporary)
    write_csv(folder / "ranking.csv", *sheet_of_ranking(table, source))


def _flat_aims(one: RankedSet) -> dict[str, float | None]:
    return {
        f"{aim}_{figure}": getattr(one.aims[aim], figure) if aim in one.aims else None
        for aim in AIMS
        for figure in ("difference", "lower", "upper")
    }


def _write_per_flight(folder: Path, flights: Sequence[AnalyzedFlight]) -> None:
    rows: list[dict[str, Any]] = []
    for flight in flights:
        if flight.evidence is not None:
            parts = {aim: flight.evidence.aim(aim) for aim in AIMS}
            unknown = np.full(len(flight.evidence.sets), np.nan)
            scores = {"score": flight.evidence.scores}
            scores |= {f"{aim}_score": unknown if part is None else part.scores for aim, part in parts.items()}
            for index, name in enumerate(flight.evidence.sets):
                own = {figure: float(values[index]) for figure, values in scores.items()}
                rows.append({"flight": flight.name, "set": name, **own})
    figures = ["score", *(f"{aim}_score" for aim in AIMS)]
    schema = pa.schema([("flight", pa.string()), ("set", pa.string()), *((name, pa.float64()) for name in figures)])
    with atomic_path(folder / "per_flight.parquet") as temporary:
        write_table(pa.Table.from_pylist(rows, schema=schema), temporary)


def _vehicle_parameters(newest: AnalyzedFlight | None, present: str, saved: AnyPath | None) -> VehicleParameters:
    if newest is not None and saved is not None:
        return vehicle_parameters(Path(saved) / newest.name)
    return of_replayed(newest.summary["sets"].get(present, {}).get("parameters", {}) if newest is not None else {})


def _reason(choice: Choice, settings: DecisionSettings) -> str:
    """What is expected of the change, with its interval."""
    if choice.pick is None:
        return ""
    best = choice.pick
    span = smaller(best.lower, best.upper, settings.confidence)
    note = ", exploratory" if choice.exploratory else ""
    return (
        f"set {best.name}: prediction errors {best.improvement_percent:.1f} % smaller ({span}), "
        f"better on {best.flights_better} of {best.flights} flights{note}"
    )


def _files_origin(
    choice: Choice,
    decision: dict[str, Any],
    newest: AnalyzedFlight | None,
    vehicle: VehicleParameters,
    settings: DecisionSettings,
) -> FilesOrigin:
    lines = [f"written by {decision['provenance']['product']}, decision: {choice.status} ({choice.chosen})"]
    if decision["vehicle"] is not None:
        lines.append(f"for the {decision['vehicle']['in_words']}")
    if newest is not None:
        lines.append(f"previous values from flight {newest.name}, firmware {newest.summary['firmware']}")
    if choice.pick is not None:
        lines.append(
            f"flights of the decision: {named([one['flight'] for one in decision['flights'] if one['scored']])}"
        )
    if choice.exploratory:
        lines.append(f"exploratory: flights in the decision: {decision['flights_scored']}")
    intervals = newest.summary["intervals_us"] if newest is not None else []
    start_us = vehicle.log_start_us
    scored_from_s = 1e-6 * (intervals[0][0] - start_us) if intervals and start_us is not None else None
    log = newest.name if newest is not None else ""
    return FilesOrigin(tuple(lines), _reason(choice, settings), log, scored_from_s)
