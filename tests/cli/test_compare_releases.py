"""`fusetune compare-releases`: its table, document and figure, for the one release that needs no compiling."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fusetune.cli import main
from fusetune.ekf2.releases import behaviours


def test_table_document_and_figure_are_of_the_same_replays(
    golden_logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, figure = str(sorted(golden_logs.glob("*.ulg"))[0]), tmp_path / "releases.svg"
    assert main(["compare-releases", log, "--releases", "v1.16", "--figure", str(figure)]) == 0
    printed = capsys.readouterr().out
    assert "gnss_vel" in figure.read_text()
    assert "v1.16" in printed
    assert main(["compare-releases", log, "--releases", "v1.16", "--json"]) == 0
    (replay,) = json.loads(capsys.readouterr().out)["replays"]
    axis = next(one for one in replay["axes"] if one["source"] == "gnss_vel")
    assert axis["rms_change"] is None
    assert f"{axis['rms']:.3g}" in next(line for line in printed.splitlines() if line.startswith("gnss_vel x"))


def test_a_release_that_is_none_or_not_modelled_is_refused(
    golden_logs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    log = str(sorted(golden_logs.glob("*.ulg"))[0])
    with pytest.raises(SystemExit) as ended:
        main(["compare-releases", log, "--releases", "v2.0"])
    assert ended.value.code == 2
    assert "v2.0 is none of v1.13" in capsys.readouterr().err
    from fusetune.ekf2.releases import modelled

    monkeypatch.setattr(modelled, "MODELLED", ("v1.16",))
    assert behaviours.RELEASES[0] == "v1.13"
    assert main(["compare-releases", log, "--releases", "v1.13"]) == 2
    assert "v1.13: is no release of PX4 whose estimator can be replayed yet" in capsys.readouterr().err
