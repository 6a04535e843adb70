"""How to load what was decided, and how to go back."""

from __future__ import annotations

from fusetune.report.markup import details, paragraph

NOTHING_TO_LOAD = "There is nothing to load: best_params.params holds no parameter and says so."


def file_to_load(folder: str = "") -> str:
    """The file.

    Parameters
    ----------
    folder : where it lies, with a slash behind; beside the page where it is empty
    """
    return f'<p class="load">Load <code>{folder}best_params.params</code></p>'


def how_to_load(folder: str = "") -> str:
    """With which tool, behind a click; `folder` as of `file_to_load`."""
    text = (
        "In QGroundControl: Parameters → Tools → Load from file; reboot, and fly a short, safe flight first. "
        f"`{folder}rollback.params` brings the old values back. The same for other tools lies beside them: .parm for "
        "MAVProxy, .sh for PX4’s shell, replay_params.txt for PX4’s own replay."
    )
    return f'<div class="how">{details("How to load it, and how to go back", paragraph(text))}</div>'
