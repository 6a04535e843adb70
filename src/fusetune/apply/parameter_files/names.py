"""Names of the parameter files; imports nothing, for the rules of the workflow ask."""

BEST, ROLLBACK = "best_params", "rollback"
ALL, ALL_BACK = "all_params", "all_rollback"
REPLAY, REPLAY_DYNAMIC = "replay_params.txt", "replay_params_dynamic.txt"

PARAMETER_FILES = (
    f"{BEST}.params",
    f"{ROLLBACK}.params",
    f"{ALL}.params",
    f"{ALL_BACK}.params",
    f"{BEST}.parm",
    f"{ROLLBACK}.parm",
    f"{BEST}.sh",
    f"{ROLLBACK}.sh",
    REPLAY,
    REPLAY_DYNAMIC,
)
"""All that a decision writes for a vehicle, those that people load first before the others."""
