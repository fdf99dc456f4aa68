import socket

import pytest

from heatertune.studio import command


def test_without_nicegui_one_line_tells_what_to_install(run, monkeypatch):
    monkeypatch.setattr(command, "find_spec", lambda _: None)
    assert run("studio") == (2, "", 'error: the studio needs NiceGUI: pip install "heatertune[studio]"\n')


@pytest.mark.parametrize("given", [("no-such-log.csv",), ("--port", "70000"), ("--port", "x")])
def test_what_cannot_be_served_is_told_before_a_server_starts(run, given):
    status, out, err = run("studio", "--no-browser", *given)
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1


@pytest.mark.long
def test_a_port_that_is_taken_is_told(run):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        status, _, err = run("studio", "--no-browser", "--port", port)
    assert status == 2
    assert f"--port {port}: cannot be used" in err


def test_a_folder_that_no_design_wrote_is_refused(run, tmp_path):
    status, _, err = run("studio", "--no-browser", tmp_path)
    assert status == 2
    assert err.startswith("error: ")
