"""How long an upload waits for what."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace


@dataclass(frozen=True)
class Pace:
    """Times, in seconds, and how often something is tried.

    PX4 sends its heartbeat and SYSTEM_TIME once a second, saves changed parameters after 0.3 s and at most every 2 s
    (its `param_autosave`), and takes some ten seconds to boot.
    """

    search_s: float = 4.0
    """For which heartbeats are collected before it is said which vehicles there are."""
    heartbeat_s: float = 1.0
    """Between our own heartbeats."""
    answer_s: float = 0.7
    """First wait for an answer; each further one is longer by `longer`."""
    longest_answer_s: float = 4.0
    quiet_s: float = 1.5
    """Without a parameter, after which a listing is taken for ended, and what is missing asked for."""
    lost_s: float = 10.0
    """Without a heartbeat, after which the link counts as lost."""
    patience_s: float = 120.0
    """For which a lost link, or the end of an armed state, is waited for."""
    save_s: float = 3.0
    """From the vehicle's word that it saves to the last reading: PX4 says so before it has done it."""
    reboot_margin_s: float = 5.0
    """By how much the vehicle's time of boot has to move to count as a reboot; longer than any delay of the link."""
    longer: float = 1.5
    attempts: int = 10
    """How often something is asked."""
    passes: int = 8
    """How often all values are read again, and what is not yet as wanted is written again."""

    def times(self, factor: float) -> Pace:
        """All times longer by a factor."""
        seconds = {one.name: getattr(self, one.name) * factor for one in fields(self) if one.name.endswith("_s")}
        return replace(self, **seconds)
