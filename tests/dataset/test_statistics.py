"""The summary counts what is there."""

import numpy as np
from trial_makers import make_trials, write_data_set

from ffhnet.dataset.statistics import OUTCOMES, Rate, summarise


def test_rows_by_proposer_and_in_all(tmp_path):
    trials = make_trials(
        ["success", "missed", "collision", "success", "unstable"],
        proposer=np.array(["power"] * 3 + ["contact"] * 2),
    )
    summary = summarise(write_data_set(tmp_path / "set", trials))
    assert summary.columns == ("proposer", "executed", "success", *OUTCOMES)
    counts = {row[0]: [row[1], *row[3:]] for row in summary.rows}
    assert counts == {
        "power": ["2", "1", "1", "1", "0", "0", "0"],
        "contact": ["2", "1", "0", "0", "0", "0", "1"],
        "all": ["4", "2", "1", "1", "0", "0", "1"],
    }
    assert "1 objects, 3 views" in summary.title


def test_rate():
    assert str(Rate(1, 2)) == "50.0% (9.5% to 90.5%)"
    assert str(Rate(0, 0)) == "-"
    assert np.isnan(Rate(0, 0).value)
