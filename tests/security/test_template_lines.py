"""Parts of templates as blocks of the skeleton."""

from __future__ import annotations

from pathlib import Path

import pytest

from modelgen.generated_module.template_lines import template_block

PART = '''\
def f(x):
    """Return {{ row_count }} "things".

    More of it.
    """
    y = [{{ row_count }}, {{ entries.outputs }}]
{% for line in lines %}
    {{ line }},
{% endfor %}

    return y
'''
BLOCK = '''\
  def f(x):
      """<text>"""
      y = [<rows>, <nonzeros>]
*     <number>,

      return y


'''


def test_loops_docstrings_and_values_become_marks_and_slots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("modelgen.template_folder.template_folder", lambda: tmp_path)
    (tmp_path / "part.py.j2").write_text(PART, encoding="utf-8")
    (tmp_path / "whole.py.j2").write_text('{% include "part.py.j2" %}\n', encoding="utf-8")
    assert template_block("part.py.j2", "number") == template_block("whole.py.j2", "number") == BLOCK


def test_a_value_that_no_slot_takes_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modelgen.template_folder.template_folder", lambda: tmp_path)
    (tmp_path / "part.py.j2").write_text("x = {{ other }}\n", encoding="utf-8")
    with pytest.raises(KeyError):
        template_block("part.py.j2")
