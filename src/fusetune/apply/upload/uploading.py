"""An upload from its first heartbeat to its last word: a new one, one that is gone on with, or the way back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from fusetune.apply.upload.backup import write_backup
from fusetune.apply.upload.conversation import Conversation
from fusetune.apply.upload.difference import difference_table, needs_reboot
from fusetune.apply.upload.folders import end_others, new_folder, newest_unended, refuse_unended
from fusetune.apply.upload.journal import (
    BACKUP,
    TRANSCRIPT,
    Change,
    Goal,
    Journal,
    Record,
    read_journal,
)
from fusetune.apply.upload.judged import Judged, read_judged
from fusetune.apply.upload.links import open_link
from fusetune.apply.upload.pace import Pace
from fusetune.apply.upload.parameter_server import Listing, ParameterServer
from fusetune.apply.upload.refusals import (
    refuse_changed,
    refuse_flying,
    refuse_foreign,
    refuse_missing,
    refuse_timeless,
)
from fusetune.apply.upload.stops import LinkLost, Refusal, Stopped
from fusetune.apply.upload.transaction import Transaction, Unfinished
from fusetune.apply.upload.transcript import Transcript
from fusetune.apply.upload.values import Value
from fusetune.apply.upload.vehicles import Identity, choose_vehicle, find_vehicles, identify, learn_state
from fusetune.apply.upload.way_back import WayBack, read_way_back, refuse_other
from fusetune.errors import UserError
from fusetune.storage.files import AnyPath

Ask = Callable[[str, Callable[[], None]], bool]
"""Asks the pilot a question, and calls again and again what it is given until the answer is there."""


class Outcome(Enum):
    """How an upload ended."""

    WRITTEN = "written"
    """What was asked for stands on the vehicle, read back value by value."""
    NOTHING = "nothing"
    """Nothing was to be done, or the pilot said no."""
    TAKEN_BACK = "taken back"
    """It did not work, and all values that were written are again as they were, read back."""
    UNFINISHED = "unfinished"
    """Which values stand is not known of all; it can be gone on with."""


@dataclass(frozen=True)
class Asked:
    """What a pilot asks for.

    Attributes
    ----------
    address : of the vehicle, as `open_link` takes it
    folder : of all uploads; each has one of its own in it
    system : MAVLink id of the vehicle where several answer
    """

    address: str
    folder: Path
    ask: Ask
    transcript: Transcript
    system: int | None = None
    pace: Pace = field(default_factory=Pace)


class Upload:
    """One upload; `retries` tells afterwards how often something was asked again."""

    def __init__(self, asked: Asked) -> None:
        self.asked = asked
        self.retries = 0
        self.folder: Path | None = None

    def new(self, file: AnyPath) -> Outcome:
        """Write the values of a parameter file with its decision beside it.

        Raises
        ------
        UserError
            A file cannot be used.
        Refusal
            The vehicle is not the one, or not in the state, that it may be written to; nothing was written.
        """
        judged = read_judged(file)
        return self._with_vehicle(lambda talk: self._write_new(talk, judged))

    def rollback(self, file: AnyPath) -> Outcome:
        """Write the values of a backup, or of `rollback.params` with its decision beside it.

        Of a backup that lies beside the journal of its upload only what that wrote is taken back. Raises as `new`.
        """
        wanted = read_way_back(file)
        return self._with_vehicle(lambda talk: self._write_back(talk, wanted))

    def resume(self, folder: AnyPath | None) -> Outcome:
        """Go on with the upload of a folder, or with the newest one that has not ended.

        Raises as `new`.
        """
        folder = Path(folder) if folder is not None else None
        folder = folder or newest_unended(self.asked.folder)
        record = read_journal(folder)
        if record.ended:
            raise UserError(folder, f"has ended, with all {record.ended} values", "There is nothing to go on with")
        return self._with_vehicle(lambda talk: self._go_on(talk, folder, record))

    def _with_vehicle(self, work: Callable[[Conversation], Outcome]) -> Outcome:
        link = open_link(self.asked.address)
        talk = Conversation(link, self.asked.pace, self.asked.transcript)
        try:
            self.asked.transcript.tell(f"Listening at {link.name} …")
            talk.talk_to(choose_vehicle(find_vehicles(talk), self.asked.system))
            return self._patiently(talk, work)
        except Stopped as stop:
            # before the first write only: a transaction ends with an outcome
            raise Refusal(f"{stop}; nothing was written now", "Mend the link, and start again") from stop
        finally:
            self.retries = talk.retries
            link.close()
            self.asked.transcript.close()

    def _patiently(self, talk: Conversation, work: Callable[[Conversation], Outcome]) -> Outcome:
        """Begin anew where the link is lost before anything was written; later a transaction minds it."""
        for _ in range(talk.pace.passes):
            try:
                return work(talk)
            except LinkLost as lost:
                self.asked.transcript.tell(f"{lost}: waiting up to {talk.pace.patience_s:.0f} s for it to come back.")
                if not talk.wait_for_return():
                    raise
        raise LinkLost("the link is lost again and again")

    def _meet(self, talk: Conversation) -> tuple[Identity, ParameterServer]:
        identity = identify(talk)
        learn_state(talk)
        self.asked.transcript.tell(f"Vehicle: {identity.in_words}.")
        refuse_timeless(talk.partner)
        return identity, ParameterServer(talk, identity.encoding)

    def _write_new(self, talk: Conversation, judged: Judged) -> Outcome:
        identity, server = self._meet(talk)
        refuse_flying(talk.partner)
        refuse_foreign(judged, identity)
        refuse_unended(self.asked.folder, identity)
        listing = server.all()
        if all(listing.values.get(name) == value for name, value in judged.wanted.items()):
            return self._nothing_to_write()
        refuse_changed(judged, listing.values)
        return self._plan_and_write(talk, server, identity, listing, judged.wanted, "upload", judged.file)

    def _write_back(self, talk: Conversation, wanted: WayBack) -> Outcome:
        identity, server = self._meet(talk)
        refuse_flying(talk.partner)
        refuse_other(wanted, identity)
        listing = server.all()
        refuse_missing(wanted.values, listing.values)
        outcome = self._plan_and_write(talk, server, identity, listing, wanted.values, "rollback", wanted.file)
        stands = all(listing.values[name] == value for name, value in wanted.values.items())
        if outcome is Outcome.WRITTEN or stands:
            end_others(self.asked.folder, identity, set(wanted.values), self.folder)
        return outcome

    def _plan_and_write(
        self,
        talk: Conversation,
        server: ParameterServer,
        identity: Identity,
        listing: Listing,
        wanted: Mapping[str, Value],
        purpose: str,
        file: Path,
    ) -> Outcome:
        transcript = self.asked.transcript
        changes = tuple(
            Change(name, listing.values[name], value, needs_reboot(name))
            for name, value in wanted.items()
            if listing.values[name] != value
        )
        if not changes:
            return self._nothing_to_write()
        self.folder = folder = new_folder(self.asked.folder, identity)
        transcript.keep_in(folder / TRANSCRIPT)
        write_backup(folder / BACKUP, identity, listing)
        agrees = " Its own checksum agrees." if listing.agrees else ""
        transcript.tell(f"All {len(listing.values)} parameters are kept in {folder / BACKUP}.{agrees}")
        transcript.tell("\n".join(difference_table(changes)))
        if not self._yes(talk, f"Write {_count(changes)} to the vehicle?"):
            return Outcome.NOTHING
        refuse_flying(talk.partner)
        record = Record(purpose, str(file), identity.uuid, identity.release, identity.system, changes)
        journal = Journal(folder)
        journal.begin(record)
        outcome = self._run(talk, server, identity, journal, record)
        if outcome is Outcome.WRITTEN:
            self._tell_the_rest(listing, changes, server)
        return outcome

    def _tell_the_rest(self, listing: Listing, changes: Sequence[Change], server: ParameterServer) -> None:
        """Whether anything else has changed on the vehicle, where its checksum tells."""
        alone = listing.is_changed_only_by({change.name: change.new for change in changes}, server.checksum())
        if alone is not None:
            what = "nothing" if alone else "something"
            self.asked.transcript.tell(f"The vehicle's checksum of all parameters says that {what} else has changed.")

    def _nothing_to_write(self) -> Outcome:
        self.asked.transcript.tell("The vehicle has these values already: there is nothing to write.")
        return Outcome.NOTHING

    def _go_on(self, talk: Conversation, folder: Path, record: Record) -> Outcome:
        self.folder = folder
        self.asked.transcript.keep_in(folder / TRANSCRIPT)
        identity, server = self._meet(talk)
        if (identity.uuid, identity.release) != (record.uuid, record.release):
            raise Refusal(
                f"this is another vehicle than that of {folder}: {record.uuid or 'no id'}, PX4 {record.release}",
                "Connect that one",
            )
        refuse_flying(talk.partner)
        listing = server.all()
        transcript = self.asked.transcript
        transcript.tell(f"What stands on the vehicle, of {record.file}:")
        for change in record.changes:
            transcript.tell(f"  {change.name}: {_which(change, listing.values.get(change.name))}")
        question = "Go on, until all new values stand?" if record.goal == "new" else "Take back what was written?"
        if not self._yes(talk, question):
            return Outcome.NOTHING
        journal = Journal(folder)
        journal.write("resumed")
        return self._run(talk, server, identity, journal, record)

    def _yes(self, talk: Conversation, question: str) -> bool:
        """Ask, and listen meanwhile."""

        def meanwhile() -> None:
            for _ in talk.listen(min(0.1, talk.pace.heartbeat_s)):
                pass

        self.asked.transcript.note(f"? {question}")
        said = self.asked.ask(question, meanwhile)
        self.asked.transcript.note("yes" if said else "no")
        if not said:
            self.asked.transcript.tell("Nothing was written now.")
        return said

    def _run(
        self, talk: Conversation, server: ParameterServer, identity: Identity, journal: Journal, record: Record
    ) -> Outcome:
        transaction = Transaction(talk, server, identity, journal, record)
        transcript = self.asked.transcript
        try:
            goal = transaction.run()
        except Unfinished as unfinished:
            self._tell_unfinished(transaction, f"Not finished: {unfinished.why}.")
            return Outcome.UNFINISHED
        except OSError as error:
            self._tell_unfinished(
                transaction, f"The journal cannot be written ({error.strerror}): nothing more is sent."
            )
            return Outcome.UNFINISHED
        except KeyboardInterrupt:
            self._tell_unfinished(transaction, "Interrupted.")
            raise
        finally:
            journal.close()
        if goal == "new":
            transcript.tell(f"Done: {_count(record.changes)} written, saved and read back.")
            _tell_reboot(transcript, record)
            return Outcome.WRITTEN
        transcript.tell("All values that were written are as they were before, read back.")
        if transaction.unsaved:
            told = "It is not confirmed that they are saved"
            transcript.tell(f"{told} ({transaction.unsaved}); PX4 saves by itself: look again after the next start.")
        return Outcome.TAKEN_BACK

    def _tell_unfinished(self, transaction: Transaction, why: str) -> None:
        tell = self.asked.transcript.tell
        tell(f"{why} What is known of the vehicle:")
        tell("\n".join(transaction.state_in_words()))
        if not transaction.record.sent:
            tell("Nothing was written.")
        tell(
            f"To go on when it is there, disarmed: fusetune upload --to {self.asked.address} --resume "
            f"--folder {self.folder}. Do not fly before."
        )


def _which(change: Change, value: Value | None) -> str:
    if value is None:
        return "not on the vehicle"
    goals: dict[Value, Goal] = {change.new: "new", change.old: "old"}
    return f"{value}, {goals.get(value, 'neither the old nor the new one')}"


def _count(changes: tuple[Change, ...]) -> str:
    return f"{len(changes)} value{'' if len(changes) == 1 else 's'}"


def _tell_reboot(transcript: Transcript, record: Record) -> None:
    names = [change.name for change in record.changes if change.reboot]
    if names:
        transcript.tell(
            f"{', '.join(names)} take{'s' if len(names) == 1 else ''} effect after a reboot of the vehicle."
        )
