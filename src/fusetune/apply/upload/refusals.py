"""What has to be so before anything is written: the vehicle of the logs, its release, its values, on the ground."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.apply.upload.conversation import Station
from fusetune.apply.upload.judged import Judged
from fusetune.apply.upload.stops import Refusal
from fusetune.apply.upload.values import Value
from fusetune.apply.upload.vehicles import Identity
from fusetune.apply.upload.wire import common
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, as_float32

_MOST_NAMED = 6


def refuse_flying(station: Station) -> None:
    """Raises `Refusal` where the vehicle is armed, flies, or does not say that it is on the ground."""
    if station.flies:
        raise Refusal(f"the vehicle {station.flies}; nothing was written", "Land and disarm, then start again")
    if station.landed != common.MAV_LANDED_STATE_ON_GROUND:
        raise Refusal(
            "the vehicle does not say whether it is on the ground; nothing was written",
            "Wait until it has started, and see that this link carries EXTENDED_SYS_STATE",
        )


def refuse_timeless(station: Station) -> None:
    """Raises `Refusal` where the vehicle does not tell for how long it runs: a reboot would pass unnoticed."""
    if station.booted_s is None:
        raise Refusal(
            "the vehicle does not tell its time since boot, so that a reboot would not be noticed",
            "See that this link carries SYSTEM_TIME",
        )


def refuse_foreign(judged: Judged, identity: Identity) -> None:
    """Raises `Refusal` where the vehicle, or its release, is not that of the logs, or that cannot be known."""
    if judged.simulated == "SITL" and identity.is_simulated:
        pass  # simulators share one id
    elif not judged.uuid:
        raise Refusal(
            f"the logs do not tell which vehicle flew ({judged.vehicle}), so that this one cannot be known to be it",
            "Load the file in QGroundControl if you are sure",
        )
    elif not identity.uuid:
        raise Refusal("the vehicle does not tell its id", "Load the file in QGroundControl if you are sure")
    elif judged.uuid.casefold() != identity.uuid.casefold():
        raise Refusal(
            f"this is another vehicle than that of the logs: its board is {identity.uuid}, that of the logs "
            f"{judged.uuid} ({judged.vehicle})",
            "Connect the vehicle of the logs, or decide from flights of this one",
        )
    if judged.release != identity.release:
        raise Refusal(
            f"the vehicle runs PX4 {identity.release}, and the flights were of {judged.release}",
            "Fly with this release first: add such a flight, and run the pipeline again",
        )


def refuse_changed(judged: Judged, present: Mapping[str, Value]) -> None:
    """Raises `Refusal` where the vehicle's values are not those that were judged, or it lacks a parameter."""
    refuse_missing(judged.wanted, present)
    for name, value in judged.wanted.items():
        _refuse_value(name, value)
    differing = [
        f"{name} is {present[name]}, judged was {value}"
        for name, value in sorted(judged.present.items())
        if name in present and not present[name].is_number(value)
    ]
    if differing:
        more = f" and {len(differing) - _MOST_NAMED} more" if len(differing) > _MOST_NAMED else ""
        raise Refusal(
            f"the vehicle's present values are not those that were judged: {'; '.join(differing[:_MOST_NAMED])}{more}",
            "Fly with the present values and decide again, or set them back to what was judged",
        )


def refuse_missing(wanted: Mapping[str, Value], present: Mapping[str, Value]) -> None:
    """Raises `Refusal` where the vehicle lacks a parameter, or has one as another type."""
    for name, value in wanted.items():
        if name not in present:
            raise Refusal(
                f"the vehicle has no parameter {name}",
                "Its release may have it under another name, or only once it is switched on",
            )
        if present[name].type != value.type:
            raise Refusal(f"{name} is an {present[name].type} on the vehicle, not {value.type}", "Decide again")


def _refuse_value(name: str, value: Value) -> None:
    metadata = ALL_PARAMETERS.get(name)
    if metadata is None:
        return
    low, high = metadata.minimum, metadata.maximum
    number = value.number
    if (
        number != number
        or (low is not None and number < min(low, as_float32(low)))
        or (high is not None and number > max(high, as_float32(high)))
    ):
        raise Refusal(f"{name} = {value} is out of PX4's range", "Decide again")
