"""A lesson that `make lesson` begins keeps all rules. nbval runs the template itself."""

import nbformat
import notebook_rules as rules
import pytest
from test_teaching import wrong_in_notes, wrong_in_summaries

from tools.new_lesson import TEMPLATE, new_lesson
from tools.notebooks import FOLDER


def test_a_new_lesson_keeps_all_rules(tmp_path):
    path = new_lesson('10_count_the_losses', tmp_path)
    text = path.read_text(encoding='utf-8')
    lesson = nbformat.reads(text, as_version=4)
    assert lesson.cells[0].source.startswith('# 10 Count the losses\n')
    assert [sentence for group in rules.GROUPS for sentence in rules.problems(lesson, group)] == []
    assert rules.title_matches(path.name, lesson) == []
    assert rules.saved_as_jupyter_does(text, lesson) == []
    assert rules.links_lead_somewhere(lesson, FOLDER) == []
    assert wrong_in_summaries(lesson) == wrong_in_notes(lesson) == []
    assert '90' not in text


def test_the_template_is_one_of_the_notebooks_that_nbval_runs(pytestconfig):
    assert str(TEMPLATE.relative_to(pytestconfig.rootpath)) in pytestconfig.getini('testpaths')


@pytest.mark.parametrize('name', ['', 'count', '1_count_losses', '10_count', '10 Count losses'])
def test_a_name_of_another_form_is_refused(name, tmp_path):
    with pytest.raises(ValueError, match='make lesson NAME=10_count_the_losses'):
        new_lesson(name, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_number_is_given_once(tmp_path):
    first = new_lesson('10_count_the_losses', tmp_path)
    before = first.read_bytes()
    for name in ('10_count_the_losses', '10_find_the_losses'):
        with pytest.raises(ValueError, match='There is 10_count_the_losses.ipynb already'):
            new_lesson(name, tmp_path)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [before]
