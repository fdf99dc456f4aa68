"""The machine that runs the manual's blocks notices what it is there to notice."""

import pytest
from tests.docs.blocks import blocks, differences, refreshed, run

PAGE = """\
# A page

```python
print(6 * 7)
```

```text
42
```

Words in between.

```sh
echo one
```

Not its output:

```text
two
```
"""


def test_a_block_has_the_output_that_follows_it_and_no_other():
    first, second = blocks(PAGE)
    assert (first.kind, first.code, first.output) == ("python", "print(6 * 7)\n", "42\n")
    assert (second.kind, second.output) == ("sh", None)
    assert [run(each, {}) for each in (first, second)] == ["42\n", "one\n"]


@pytest.mark.parametrize(("shown", "printed", "found"), [
    ("K   2.96 %/°C", "K  2.961 %/°C", []),
    ("K   2.96 %/°C", "K  3.00 %/°C", ["K   2.96 %/°C"]),
    ("VERDICT PASS", "VERDICT FAIL", ["VERDICT PASS"]),
    ("a\n…\nc", "a\nb\nb\nc", []),
    ("a\nc", "a\nb\nc", ["c"]),
    ("a", "a\nb", ["printed but not shown: b"]),
    ("a\n…", "a\nb\nc", []),
    ("…\nb\na", "a\nb\nc", ["a"]),
    ("TV  −1 s", "TV  1 s", ["TV  −1 s"]),
    ("none", "", ["none"]),
])
def test_what_is_shown_must_have_been_printed(shown, printed, found):
    assert differences(shown, printed) == found


def test_the_exit_status_is_the_one_the_page_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (fails,) = blocks("```sh\nheatertune fit missing.csv # exit status 2\n```\n")
    assert run(fails, {}).startswith("error: missing.csv")
    (wrong,) = blocks("```sh\nheatertune fit missing.csv\n```\n")
    with pytest.raises(AssertionError, match=r"missing\.csv"):
        run(wrong, {})
    (shell,) = blocks("```sh\nfalse | false # exit status 1\n```\n")
    assert run(shell, {}) == ""


def test_a_refreshed_output_keeps_what_was_left_out():
    assert refreshed("a 1\n…\nc 3\n", "a 2\nb 9\nc 4\nd 5\n") == "a 2\n…\nc 4\n"
    assert refreshed("a 1\n", "a 2\nb 9\n") == "a 2\nb 9\n"
    assert refreshed("1 … 2\n", "3 to 4\n") == "3 to 4\n", "a line of its own stands for lines, not a sign within one"
