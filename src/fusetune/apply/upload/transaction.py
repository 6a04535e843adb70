"""Values brought onto the vehicle so that in the end all are new or all are old, whatever happens between.

A pass reads every value that is concerned, writes what is not yet as wanted, has the vehicle save, and after a while
reads all again. It counts if then all are as wanted and the vehicle has not rebooted since the pass began; otherwise
there is another one. What ends the way to the new values (the vehicle is armed, refuses a value, somebody else writes)
begins the way back, in reverse order. A lost link is waited for, and nothing is concluded from what was known before.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

from fusetune.apply.upload.conversation import Conversation
from fusetune.apply.upload.journal import Change, Goal, Journal, Record
from fusetune.apply.upload.parameter_server import ParameterServer
from fusetune.apply.upload.refusals import refuse_flying
from fusetune.apply.upload.stops import (
    Armed,
    ChangedMeanwhile,
    LinkLost,
    NoAnswer,
    NotTaken,
    NotTheVehicle,
    Refusal,
    Stopped,
)
from fusetune.apply.upload.values import Value
from fusetune.apply.upload.vehicles import Identity, identify, learn_state, see_boot_time

_OFTEN_REFUSED = 4
"""After so many answers that speak against a value, each confirmed by reading, the vehicle is taken not to want it."""


class _Rebooted(Exception):
    """The pass does not count."""


class Unfinished(Exception):
    """Neither all new nor all old values stand beyond doubt; the journal has what to go on with.

    Attributes
    ----------
    why : in words
    """

    def __init__(self, why: str) -> None:
        self.why = why
        super().__init__(why)


class Transaction:
    """See the module.

    Parameters
    ----------
    identity : of the vehicle; it is asked for again whenever the link or the vehicle was away
    record : what was planned, and what had been sent to when a former run ended

    Attributes
    ----------
    known : of each parameter the value last read; None where it was not read since something was sent
    unsaved : why it is not confirmed that the vehicle saved old values that were brought back; empty where it is
    """

    def __init__(
        self, talk: Conversation, server: ParameterServer, identity: Identity, journal: Journal, record: Record
    ) -> None:
        self._talk = talk
        self._server = server
        self._identity = identity
        self._journal = journal
        self.record = record
        self.known: dict[str, Value | None] = {change.name: None for change in record.changes}
        self.unsaved = ""
        self._reboots = 0

    def run(self) -> Goal:
        """Bring all new values onto the vehicle, or all old ones back.

        Returns
        -------
        Goal
            Which of them stand, read back one by one after the vehicle said that it saves them.

        Raises
        ------
        Unfinished
            The link or the vehicle is gone, or it stays armed.
        """
        if self.record.goal == "new":
            try:
                self._bring("new")
                return self._end("new")
            except NotTheVehicle as stop:
                raise Unfinished(str(stop)) from stop
            except Stopped as stop:
                self._go_back(str(stop))
        while True:
            try:
                self._wait_for_ground()
                self._bring("old")
                return self._end("old")
            except Armed as stop:
                self._talk.transcript.tell(f"{_sentence(str(stop))} The rest is taken back when it is disarmed.")
            except Stopped as stop:
                raise Unfinished(str(stop)) from stop

    def state_in_words(self) -> list[str]:
        """What is known to stand on the vehicle, a line for each value."""
        return [f"  {one.name}: {self._state(one)}" for one in self.record.changes]

    def _state(self, change: Change) -> str:
        value = self.known[change.name]
        if value == change.new:
            return f"{change.new}, the new value, as last read"
        if value == change.old:
            return f"{change.old}, the old value, as last read"
        if value is not None:
            return f"{value}, neither the old value {change.old} nor the new one {change.new}"
        if change.name in self.record.sent:
            return f"not known: {change.new} was sent, {change.old} was there before"
        return f"{change.old}, the old value: nothing was sent"

    def _go_back(self, why: str) -> None:
        self._journal.write("going back", why=why)
        self.record.goal, self.record.why_back = "old", why
        self._talk.transcript.tell(f"{_sentence(why)} Writing stops; what was written is taken back. What stands now:")
        self._talk.transcript.tell("\n".join(self.state_in_words()))

    def _end(self, goal: Goal) -> Goal:
        self._journal.write("ended", **{"with": goal})
        self.record.ended = goal
        return goal

    def _bring(self, goal: Goal) -> None:
        """Passes until one counts; raises `Stopped` where none can."""
        order = list(self.record.changes) if goal == "new" else list(reversed(self.record.changes))
        if goal == "old":
            order = [change for change in order if change.name in self.record.sent]
        for _ in range(self._talk.pace.passes):
            try:
                if self._pass(order, goal):
                    return
            except _Rebooted:
                self._journal.write("rebooted")
                self._talk.transcript.tell("The vehicle has rebooted meanwhile: all values are read again.")
            except LinkLost as lost:
                self._wait_for_link(lost)
        raise NoAnswer("the values do not stay as they were written")

    def _pass(self, order: Sequence[Change], goal: Goal) -> bool:
        self._reboots = self._talk.partner.reboots
        self._see_who_it_is()
        with self._talk.guarded():
            for change in order:
                if self._read(change, goal) != change.value(goal):
                    self._write(change, goal)
            if not order:
                return True
            self._save(goal)
            for _ in self._talk.listen(self._talk.pace.save_s):
                pass
            read = [(self._read(change, goal), change.value(goal)) for change in order]
        see_boot_time(self._talk)
        self._see_that_it_runs_on()
        return all(value == wanted for value, wanted in read)

    def _read(self, change: Change, goal: Goal) -> Value:
        value = self._server.read(change.name)
        self.known[change.name] = value
        if goal == "new" and value not in (change.old, change.new) and change.name not in self.record.sent:
            raise ChangedMeanwhile(f"somebody else has changed {change.name}: {value}, before {change.old}")
        return value

    def _write(self, change: Change, goal: Goal) -> None:
        """Write until the value is read back as it was sent."""
        wanted, wait_s, refused, against = change.value(goal), self._talk.pace.answer_s, 0, dict[str, None]()
        for attempt in range(self._talk.pace.attempts):
            self._talk.retries += attempt > 0
            self._talk.see_that_it_is_disarmed()
            self._see_that_it_runs_on()
            self._journal.write("sending", name=change.name, value=f"{wanted.bits:08x}")
            if change.name not in self.record.sent:
                self.record.sent.append(change.name)
            self.known[change.name] = None
            said = self._server.set_once(change.name, wanted, wait_s)
            value = self._read(change, goal)
            if value == wanted:
                self._journal.write("verified", name=change.name, value=f"{value.bits:08x}")
                return
            if said is not None:
                refused, against[said] = refused + 1, None
            if refused >= _OFTEN_REFUSED:
                break
            wait_s = min(wait_s * self._talk.pace.longer, self._talk.pace.longest_answer_s)
        because = f" ({', '.join(against)})" if against else ""
        raise NotTaken(f"the vehicle does not take {change.name} = {wanted}{because}; it keeps {value}")

    def _see_that_it_runs_on(self) -> None:
        """Raises `_Rebooted` where it does not: it may be another vehicle, or have lost what was written."""
        if self._talk.partner.reboots != self._reboots:
            raise _Rebooted

    def _save(self, goal: Goal) -> None:
        self.unsaved = ""
        self._talk.see_that_it_is_disarmed()
        try:
            self._server.save()
        except NoAnswer as error:
            if goal == "new":
                raise
            # the way back ends there in any case; PX4 saves by itself
            self.unsaved = str(error)
        self._journal.write("saved", confirmed=not self.unsaved)

    def _see_who_it_is(self) -> None:
        """Ask for the identity anew, and compare; the vehicle may have been exchanged while nobody listened."""
        try:
            now = identify(self._talk)
        except Refusal as error:
            raise NotTheVehicle(str(error)) from error
        if (now.uuid, now.release) != (self._identity.uuid, self._identity.release):
            raise NotTheVehicle(f"another vehicle answers now: {now.in_words}")
        learn_state(self._talk)

    def _wait_for_link(self, lost: LinkLost) -> None:
        talk = self._talk
        self._journal.write("link lost", why=str(lost))
        patience_s = talk.pace.patience_s
        talk.transcript.tell(f"{_sentence(str(lost))} Waiting up to {patience_s:.0f} s for it to come back.")
        if not talk.wait_for_return():
            raise Unfinished(str(lost))
        self._journal.write("link back")
        talk.transcript.tell("The vehicle is back: all values are read again.")

    def _wait_for_ground(self) -> None:
        """Wait until the vehicle is disarmed and on the ground."""
        talk, told = self._talk, False
        until = time.monotonic() + talk.pace.patience_s
        while True:
            try:
                talk.see_that_it_is_disarmed()
                refuse_flying(talk.partner)
                return
            except LinkLost as lost:
                self._wait_for_link(lost)
            except Refusal as refusal:
                if not told:
                    talk.transcript.tell(f"{_sentence(refusal.reason.partition(';')[0])} Waiting until it is disarmed.")
                    told = True
                if time.monotonic() > until:
                    raise Unfinished(refusal.reason.partition(";")[0]) from refusal
                for _ in talk.listen(talk.pace.heartbeat_s):
                    pass


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."
