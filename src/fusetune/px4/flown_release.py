"""Which release's estimator flew, by all that a log tells: commit, number, parameters, flags."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from fusetune.px4.flight import Flight
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS
from fusetune.px4.release_signs import Span, spans_of, strangers
from fusetune.px4.release_tags import DIGITS, TAGS
from fusetune.px4.releases import DEVELOPMENT, FIRST, READ, Release, estimator_name, number_of_name

CANDIDATES: tuple[Release, ...] = (*READ, DEVELOPMENT)

_SPEAKS_AGAINST = 2
"""Parameters and flags by which another release has to fit better than the one that the log names; one may be odd."""

_ENOUGH_PARAMETERS = 60
"""A log with so many parameters of EKF2 holds nearly all of its release, so what it lacks tells, too."""

_MOST_NAMED = 3
_IN_A_BRANCH = re.compile(r"(?<![\d.])v?1\.(\d{1,2})(?:\.\d+)?(?![\d.])")


@dataclass(frozen=True)
class FlownRelease:
    """The release that flew, without its patch.

    Attributes
    ----------
    release : `releases.DEVELOPMENT` stands for PX4's development branch; None where the log does not tell
    evidence : by what it is known, in words
    own_parameters : of EKF2, which no release of PX4 has: those of a vendor's fork
    """

    release: Release | None
    evidence: str
    own_parameters: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Such as "v1.16" or "main"; "unknown" where the log does not tell."""
        return "unknown" if self.release is None else estimator_name(self.release)


def flown_release(flight: Flight) -> FlownRelease:
    """Tell which release flew.

    What the log names, by commit, number or branch, counts unless its parameters and flags are clearly another
    release's: builds between releases carry the number of the one before or after, and vendors' builds any.

    Parameters
    ----------
    flight : of any layout; its topics are not looked at, so it is the same however few of them were read
    """
    names = [name for name in flight.parameters.initial if name.startswith("EKF2_")]
    spans = spans_of(names, flight.release_signs)
    own = tuple(sorted(name for name in names if name not in ALL_PARAMETERS))
    told, evidence = _told(flight)
    fit = {release: len(strangers(spans, release)) for release in CANDIDATES}
    if told is None:
        return FlownRelease(*_by_signs(names, fit), own)
    named = min(told, DEVELOPMENT)
    if named < FIRST:
        return FlownRelease(named, evidence, own)
    best = min(CANDIDATES, key=lambda release: (fit[release], abs(release[1] - named[1])))
    if fit[named] - fit[best] < _SPEAKS_AGAINST:
        return FlownRelease(named, evidence, own)
    because = f"{_named(spans, named, best)} {'are' if fit[named] > 1 else 'is'} {estimator_name(best)}'s"
    return FlownRelease(best, f"{evidence}, but {because}", own)


def _told(flight: Flight) -> tuple[Release | None, str]:
    """What the log itself names, and in which words."""
    tag = TAGS.get(str(flight.info.get("ver_sw", "")).lower()[:DIGITS])
    if tag is not None:
        return number_of_name(tag.name.rpartition(".")[0]), f"built from the tag {tag.name} of {tag.date}"
    if flight.release is not None:
        major, minor, _ = flight.release
        return (major, minor), f"the log names {flight.release_name}"
    branch = str(flight.info.get("ver_sw_branch", ""))
    found = _IN_A_BRANCH.search(branch)
    if found is not None:
        return (1, int(found[1])), f"built from the branch {branch}"
    return None, ""


def _by_signs(names: list[str], fit: Mapping[Release, int]) -> tuple[Release | None, str]:
    """The release whose parameters and flags those of the log are, where that is one alone."""

    def lacking(release: Release) -> int:
        return sum(one.exists_in(release) and name not in names for name, one in ALL_PARAMETERS.items())

    fitting = [release for release in CANDIDATES if fit[release] == min(fit.values())]
    if len(names) >= _ENOUGH_PARAMETERS:
        fewest = min(map(lacking, fitting))
        fitting = [release for release in fitting if lacking(release) == fewest]
    if len(fitting) != 1:
        return None, "the log does not say which release flew, nor do its parameters"
    return fitting[0], f"the log names no release; its parameters are {estimator_name(fitting[0])}'s"


def _named(spans: Mapping[str, Span], told: Release, best: Release) -> str:
    """Some of what one release lacks and the other has."""
    names = sorted({*strangers(spans, told)} - {*strangers(spans, best)})
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return ", ".join(names[:_MOST_NAMED]) + more
