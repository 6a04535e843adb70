"""Which mission the flight flew, leg by leg, and how long it did what."""

from __future__ import annotations

from fusetune.analyze.conformance.flown_track import FlownTrack
from fusetune.analyze.conformance.words import TRACK_WORDS, leg_name
from fusetune.analyze.flight.manoeuvre_classes import FLOWN_CLASSES
from fusetune.report.charts.conformance import conformance_chart
from fusetune.report.flight_results import Document
from fusetune.report.markup import Cell, details, number, paragraph, section, signed, table


def conformance_section(document: Document, track: FlownTrack | None) -> str:
    """The verdict of each mission, the map, manoeuvres, waypoints and legs in tables behind a click.

    Parameters
    ----------
    document : `conformance.json`
    track : of the flight; None where none was logged
    """
    missions = document["missions"]
    if document["why_not_compared"]:
        parts = [paragraph(f"It was compared with no mission: {document['why_not_compared']}.")]
    else:
        parts = [paragraph(_verdict(one)) for one in missions]
    parts.append(details("From above, by manoeuvre", conformance_chart(track, document)))
    parts.append(details("How long it did what", _manoeuvre_table(document)))
    flown = next((one for one in missions if one["mission"] == document["flown"]), None)
    if flown is not None:
        words = TRACK_WORDS[document["track"]]
        text = f"Places are those of {words}, and off by what the GNSS receiver is off by for minutes."
        parts.append(paragraph(text, "note"))
        parts.append(details("Its legs", _leg_table(flown)))
        parts.append(details("Its waypoints", _waypoint_table(flown, document["start_us"])))
    return section("What was flown", *parts, id="flown")


def _verdict(mission: Document) -> str:
    said = {
        "flew": "It flew the mission",
        "flew in part": "It flew a part of the mission",
        "flew otherwise": "It flew the mission otherwise than planned:",
        "not this mission": "It did not fly the mission",
    }[mission["verdict"]]
    return f"{said} {mission['mission']}: {mission['why']}."


def _manoeuvre_table(document: Document) -> str:
    seconds = dict.fromkeys(FLOWN_CLASSES, 0.0)
    times = dict.fromkeys(FLOWN_CLASSES, 0)
    for one in document["manoeuvres"]:
        if one["kind"] in seconds:
            seconds[one["kind"]] += (one["stop_us"] - one["start_us"]) * 1e-6
            times[one["kind"]] += 1
    rows = [(kind, number(float(times[kind])), number(seconds[kind])) for kind in FLOWN_CLASSES if times[kind]]
    return table(("manoeuvre", "times", "seconds in all"), rows) if rows else ""


def _leg_table(mission: Document) -> str:
    head = ("leg", "beside it, mean m", "95 % m", "most m", "height m", "speed m/s", "planned m/s")
    rows: list[tuple[Cell | str, ...]] = []
    for leg in mission["legs"]:
        found = leg["figures"]
        if found is None:
            why = "not flown" if leg["start_us"] is None else "too short to tell"
            rows.append((leg_name(leg), Cell(why, "quiet"), "", "", "", "", number(leg["planned_speed_m_s"])))
            continue
        rows.append(
            (
                leg_name(leg),
                _metres(found["cross_track_mean"]),
                _metres(found["cross_track_95"]),
                _metres(found["cross_track_max"]),
                signed(found["height_error_mean"], 2),
                number(found["speed"]),
                number(leg["planned_speed_m_s"]),
            )
        )
    return table(head, rows)


def _metres(value: float) -> Cell:
    """A distance to a centimetre."""
    return Cell(f"{value:.2f}", "number")


def _waypoint_table(mission: Document, start_us: int) -> str:
    rows = []
    for one in mission["waypoints"]:
        state = "missed" if not one["passed"] else "passed" if one["in_order"] else "out of order"
        kind = {"missed": "bad", "passed": "good", "out of order": "bad"}[state]
        when = Cell("–", "number quiet") if one["time_us"] is None else number((one["time_us"] - start_us) * 1e-6, 4)
        rows.append(
            (
                str(one["waypoint"] + 1),
                Cell(state, kind),
                when,
                _metres(one["miss_m"]),
                _metres(one["allowed_m"]),
                signed(one["height_error_m"], 2),
            )
        )
    return table(("waypoint", "", "after s", "nearest m", "allowed m", "height m"), rows)
