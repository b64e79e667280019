"""What is shown while something is done, beside the results."""

import sys

from pnpct.cli.terminal import say, track, working


def test_results_go_to_stdout_while_progress_shows_on_the_terminal(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)  # and stdout is a file
    monkeypatch.setenv("TERM", "xterm")
    with working("Thinking"):
        say("a result")
    for item in track("bc", total=2, of="Items"):
        say(f"{item} is done")
    out, err = capsys.readouterr()
    assert out == "a result\nb is done\nc is done\n"
    assert "Thinking" in err
    assert "Items" in err
