"""The progress bar of commands that draw for long."""

import time

from ncrs.commands import progress_bar


def test_the_bar_is_for_slow_work_only(capsys):
    with progress_bar("Drawing", "figure") as progress:
        progress(1, 2)
    assert capsys.readouterr() == ("", "")
    with progress_bar("Drawing", "figure") as progress:
        progress(1, 4)
        time.sleep(1.1)
        progress(3, 4)
    output, error = capsys.readouterr()
    assert output == ""
    assert "Drawing:  75%" in error
    assert "3/4" in error
