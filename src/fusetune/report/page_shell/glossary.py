"""Words of the field, told where they first stand in a tab and as a list."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape

from fusetune.report.page_shell.text_pass import map_text

_SKIPPED = frozenset(
    ("a", "abbr", "button", "code", "dfn", "dt", "h1", "h2", "summary", "option", "label", "figcaption", ".whole",
     ".glossary")
)  # fmt: skip


@dataclass(frozen=True)
class Term:
    """A word of the field.

    Attributes
    ----------
    id : in the page
    name : as the list has it
    told : what it means, in a sentence or two
    spellings : as it stands in the text, singular and plural; the name itself where nothing is given
    """

    id: str
    name: str
    told: str
    spellings: tuple[str, ...] = field(default=())

    @property
    def written(self) -> tuple[str, ...]:
        """All spellings."""
        return self.spellings or (self.name,)


TERMS = (
    Term(
        "aid-source",
        "aid source",
        "A sensor that corrects what the inertial sensors predict: GNSS, barometer, magnetometer, optical flow, "
        "vision, airspeed.",
        ("aid source", "aid sources"),
    ),
    Term(
        "aided",
        "aided",
        "Judged one step ahead: how far off each measurement was predicted before the filter used it, with all "
        "sensors at work.",
    ),
    Term(
        "allan",
        "Allan deviation",
        "How much the mean of a sensor at rest still varies, over averages of growing length. Its slopes tell "
        "white noise from bias that wanders.",
    ),
    Term(
        "bias",
        "bias",
        "A constant error of a sensor. The filter estimates those of gyroscope and accelerometer as it flies.",
        ("bias", "biases"),
    ),
    Term(
        "consistent",
        "consistency",
        "A filter is consistent if its errors are as large as it says they are. Measured by the NIS.",
        ("consistency", "consistent filter"),
    ),
    Term(
        "eligible",
        "eligible",
        "A set that may be chosen: scored on the flights, nothing speaks against it, and it is beyond doubt worse "
        "in no way of predicting.",
        ("eligible", "not eligible"),
    ),
    Term(
        "exploratory",
        "exploratory",
        "From too few flights to rely on: a first look, not a proof.",
    ),
    Term(
        "break",
        "fusion break",
        "A sample so far from its prediction that the filter did not use it.",
        ("fusion break", "fusion breaks", "break rate"),
    ),
    Term(
        "fusion-horizon",
        "fusion time horizon",
        "EKF2 works some tenths of a second in the past, where measurements of all delays are at hand, and "
        "predicts from there to now.",
        ("fusion time horizon",),
    ),
    Term(
        "gate",
        "gate",
        "How many standard deviations a measurement may lie from its prediction before the filter rejects it.",
        ("gate", "gates"),
    ),
    Term(
        "innovation",
        "innovation",
        "What was measured less what the filter predicted, before it used the measurement.",
        ("innovation", "innovations"),
    ),
    Term(
        "innovation-variance",
        "innovation variance",
        "How large the filter expects the square of an innovation to be: its own uncertainty and the noise of the "
        "sensor together.",
        ("innovation variance", "innovation variances"),
    ),
    Term(
        "interval",
        "interval",
        "Where the true value probably lies: of a 95 % interval, 95 of 100 made like it hold it. For changes it "
        "tells how much flights differ.",
        ("interval", "intervals"),
    ),
    Term(
        "lever-arm",
        "lever arm",
        "Where a sensor sits, seen from the IMU. When the vehicle turns the sensor moves otherwise than the IMU.",
        ("lever arm", "lever arms"),
    ),
    Term(
        "nis",
        "NIS",
        "Normalised innovation squared: squared innovation over its variance. Its mean is the number of axes where "
        "the filter is right about its uncertainty; less means it claims too much noise, more too little.",
        ("NIS",),
    ),
    Term(
        "nll",
        "NLL",
        "Negative log likelihood: how surprised a filter is by its measurements. Lower is better; here its scale "
        "is set to fit, so that claiming more noise earns nothing.",
        ("NLL",),
    ),
    Term(
        "p-value",
        "p",
        "How often chance alone would show a difference as large, were there none. Small is convincing.",
        ("p-value", "p, all sets"),
    ),
    Term(
        "pareto",
        "Pareto front",
        "Sets that can be bettered in one aim only by losing in the other.",
        ("Pareto front",),
    ),
    Term(
        "prediction-error",
        "prediction error",
        "How far off the estimator was when it predicted a measurement it had not seen. Changes of it are in "
        "percent against what flies now: below 0 is better.",
        ("prediction error", "prediction errors"),
    ),
    Term(
        "present-set",
        "present set",
        "The parameters that fly now: those that the newest flight ended with.",
        ("present set", "present one"),
    ),
    Term(
        "replay",
        "replay",
        "The estimator run again over the logged sensor data, here with other parameters.",
        ("replay", "replayed", "replays"),
    ),
    Term(
        "reset",
        "reset",
        "The filter gives up a state and takes the measured value: position, velocity, height or heading jumps.",
        ("reset", "resets"),
    ),
    Term(
        "rms",
        "RMS",
        "Root mean square: the usual size of an error.",
        ("RMS",),
    ),
    Term(
        "sensitivity",
        "sensitivity",
        "How much prediction errors change when one parameter does.",
        ("sensitivity",),
    ),
    Term(
        "smoothed",
        "smoothed",
        "Judged against the velocity that the whole flight, before and after, makes likely.",
        ("smoothed velocity", "smoothed"),
    ),
    Term(
        "sobol",
        "Sobol index",
        "The share of a change that is due to one parameter, alone or together with others.",
        ("Sobol index", "Sobol indices"),
    ),
    Term(
        "test-ratio",
        "test ratio",
        "Squared innovation over what the gate allows. Above 1 the filter rejects the measurement.",
        ("test ratio", "test ratios"),
    ),
    Term(
        "trust-grade",
        "trust grade",
        "How well the replay of a flight's own parameters repeats what the vehicle logged: A and B repeat it, of a "
        "C only clear differences can be trusted, a D does not count.",
        ("trust grade", "trust grades", "trust"),
    ),
    Term(
        "unaided",
        "unaided",
        "Judged by drift: how far velocity and position were off after seconds without GNSS.",
    ),
    Term(
        "white",
        "white",
        "An error is white if one sample tells nothing of the next. Filters take errors for white; one that "
        "wanders misleads them.",
        ("white", "whiteness", "white share"),
    ),
)
"""In the order of the alphabet."""


def with_terms_marked(html: str, used: set[str]) -> str:
    """HTML with each term marked where it first stands in running text.

    Parameters
    ----------
    used : takes the ids of the terms that were found
    """
    open_terms = {spelling.lower(): term for term in TERMS for spelling in term.written}
    marked: set[str] = set()

    def pattern() -> re.Pattern[str] | None:
        words = [word for word, term in open_terms.items() if term.id not in marked]
        if not words:
            return None
        ordered = sorted(words, key=len, reverse=True)
        return re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, ordered))})(?![\w-])", re.IGNORECASE)

    found = pattern()

    def change(text: str) -> str:
        nonlocal found
        at = 0
        parts = []
        while found is not None and (match := found.search(text, at)) is not None:
            term = open_terms[match[0].lower()]
            # NIS is a term, an English word in small letters is not
            if term.name.isupper() and not match[0].isupper():
                parts.append(text[at : match.end()])
            else:
                mark = f'<dfn class="term" tabindex="0" data-term="{term.id}">{match[0]}</dfn>'
                parts += [text[at : match.start()], mark]
                marked.add(term.id)
                found = pattern()
            at = match.end()
        return "".join(parts) + text[at:]

    result = map_text(html, change, skip=_SKIPPED)
    used |= marked
    return result


def glossary_list(ids: Iterable[str]) -> str:
    """The terms as a list, to which the marks lead."""
    wanted = set(ids)
    entries = "".join(
        f'<div><dt>{escape(term.name)}</dt><dd id="term-{term.id}">{escape(term.told)}</dd></div>'
        for term in TERMS
        if term.id in wanted
    )
    return f'<dl class="glossary">{entries}</dl>' if entries else ""
