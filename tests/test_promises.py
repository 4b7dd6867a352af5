"""What the documents promise, and no other test tries: links, commands, numbers, licences."""

import re
import subprocess
import tomllib
from importlib.metadata import PackageNotFoundError, metadata, packages_distributions

import pytest
import yaml
from support.imports import imported_packages

from helpers.checks import tasks
from helpers.lesson import ROOT, path_of, read

DOCUMENTS = [
    *sorted(ROOT.glob('*.md')),
    *sorted(ROOT.glob('.github/**/*.md')),
    *(ROOT / 'tools/UPGRADING.md', ROOT / 'helpers/README.md', ROOT / 'ros2/README.md'),
    *sorted(ROOT.glob('classroom/*.md')),
]
# Its links are those of an archive: classroom/tests/test_handout.py follows them.
STUDENTS = ROOT / 'classroom/students.md'
CHANGES = ROOT / 'CHANGELOG.md'  # names commands of the past, too
of_each_document = pytest.mark.parametrize(
    'document', DOCUMENTS, ids=[str(path.relative_to(ROOT)) for path in DOCUMENTS]
)
MAKEFILE = (ROOT / 'Makefile').read_text(encoding='utf-8')
README, ENVIRONMENT, CONTRIBUTING = (
    (ROOT / name).read_text(encoding='utf-8')
    for name in ('README.md', 'environment.md', 'CONTRIBUTING.md')
)
# Of the groups of pyproject.toml, those whose packages the tests have.
LOCKS = ('requirements.lock', 'requirements-test.lock')


def without_code(text):
    """Return a text without what only looks like links."""
    return re.sub(r'```.*?```|`[^`]*`', '', text, flags=re.DOTALL)


def anchors(path):
    """Return the places in a file that a link may name."""
    if path.suffix == '.ipynb':  # as JupyterLab makes them
        cells = read(path.read_text(encoding='utf-8'), path.name).cells
        text = '\n'.join(cell.source for cell in cells if cell.cell_type == 'markdown')
        return {title.replace(' ', '-') for title in re.findall(r'^#+ (.+)$', text, re.M)}
    text = re.sub(r'```.*?```', '', path.read_text(encoding='utf-8'), flags=re.DOTALL)
    titles = re.findall(r'^#+ (.+)$', text, re.M)  # as GitHub does
    return {re.sub(r'[^\w -]', '', title).lower().replace(' ', '-') for title in titles}


@of_each_document
def test_a_link_leads_somewhere(document):
    if document == STUDENTS:
        return
    wrong = []
    for target in re.findall(r'\]\(([^)\s]+)\)', without_code(document.read_text())):
        if re.match(r'[a-z]+:', target):
            continue
        name, _, anchor = target.partition('#')
        path = document.parent / name if name else document
        if not path.exists() or (anchor and anchor not in anchors(path)):
            wrong.append(target)
    assert wrong == []


@of_each_document
def test_a_command_that_it_names_exists_with_its_options(document):
    if document == CHANGES:
        return
    option = r' [A-Z_]+=(?:"[^"]*"|[^` ]*)'
    named = re.findall(rf'`make ([a-z0-9-]+)((?:{option})*)', document.read_text(encoding='utf-8'))
    commands = set(re.findall(r'^([a-z0-9-]+):', MAKEFILE, re.M))
    options = set(re.findall(r'\b([A-Z_]+)=|\$\(([A-Z_]+)\)', MAKEFILE))
    assert {command for command, _ in named} <= commands
    given = {name for _, words in named for name in re.findall(r'([A-Z_]+)=', words)}
    assert given <= {name for names in options for name in names}


def test_help_lists_every_command():
    said = subprocess.run(['make', '-s', 'help'], cwd=ROOT, capture_output=True, text=True).stdout
    listed = set(re.findall(r'^  make ([a-z0-9-]+) ', said, re.M))
    phony = re.search(r'^\.PHONY: (.*)', MAKEFILE.replace('\\\n', ''), re.M)[1]
    assert listed == set(phony.split()) - {'set_up'}


@pytest.mark.parametrize('name', ['README.md', 'environment.md', 'classroom/students.md'])
def test_the_pythons_are_those_that_have_all_wheels(name):
    lock = (ROOT / 'tools/locks/requirements.lock').read_text()
    newest, *_, oldest = re.search(r'^# Every wheel exists for Python (.+)', lock, re.M)[1].split()
    named = re.findall(r'Python (3\.\d+) to (3\.\d+)', (ROOT / name).read_text())
    assert named
    assert {*named} == {(oldest, newest)}


def test_page_99_has_as_many_answers_as_the_readme_says_each_with_its_source():
    page = path_of('look_up_a_term')
    cells = read(page.read_text(encoding='utf-8'), page.name).cells
    texts = [cell.source for cell in cells if cell.cell_type == 'markdown']
    first = next(i for i, text in enumerate(texts) if text.startswith('## Messages of programs'))
    tables = re.findall(r'(?:^\|.*\n?)+', '\n\n'.join(texts[first:]), re.M)
    rows = [row for table in tables for row in table.splitlines()[2:]]
    assert [row for row in rows if not re.search(r'\]\(https://', row)] == []
    promised = int(re.search(r'has ([\d,]+) answers', README)[1].replace(',', ''))
    assert promised <= len(rows) < promised + 50, 'Say it in README.md.'


def test_what_happens_without_a_message_is_in_tables_that_one_can_read():
    """Each has its subject above it, and a person who looks for a row reads 30 at most."""
    page = path_of('look_up_a_term')
    cells = read(page.read_text(encoding='utf-8'), page.name).cells
    texts = [cell.source for cell in cells if '| what happens |' in cell.source]
    subjects = [re.findall(r'^### (.+)$', text, re.M) for text in texts]
    rows = [len(re.findall(r'^\| ', text, re.M)) - 1 for text in texts]
    assert len(texts) > 5
    assert [text[:40] for text, above in zip(texts, subjects, strict=True) if len(above) != 1] == []
    assert [above for above, count in zip(subjects, rows, strict=True) if count > 30] == []
    assert len({above for (above,) in subjects}) == len(texts)


def test_a_message_that_ends_with_what_to_do_is_one_of_ours():
    """Their words are in the code, but for what a message fills in."""
    listed = re.search(r'These messages end with what to do: (.*?)\.\n\n', ENVIRONMENT, re.S)[1]
    files = [*ROOT.glob('tools/*.sh'), *ROOT.glob('tools/*.py')]
    files += [*ROOT.glob('helpers/**/*.py'), *ROOT.glob('ros2/ros2_command/**/*.py')]
    code = ' '.join(re.sub(r"'\s+f?'|\s+", ' ', file.read_text()) for file in files)
    unknown = []
    for message in re.findall(r'`([^`]+)`', listed):
        parts = re.split(r'3\.11 to 3\.14|python3 |\.\.\.|\d+', message.replace('\n', ' '))
        unknown += [part for part in parts if part.strip() not in code]
    assert unknown == []


def test_what_ci_runs_weekly_is_in_its_file():
    weekly = yaml.safe_load((ROOT / '.github/workflows/weekly.yml').read_text())
    run = ' '.join(step.get('run', '') for job in weekly['jobs'].values() for step in job['steps'])
    rows = re.findall(r'^\| `(make [a-z-]+).*CI runs (?:it|both) weekly', CONTRIBUTING, re.M)
    assert len(rows) > 3
    assert [command for command in rows if command not in run] == []


def licence(name):
    """Return what an installed package says of its licence, in one text."""
    try:
        about = metadata(name)
    except PackageNotFoundError:  # only another Python needs it
        return ''
    short = about.get('License-Expression') or (about.get('License') or '').partition('\n')[0]
    kinds = about.get_all('Classifier', [])
    return ' '.join([short, *(kind for kind in kinds if kind.startswith('License'))])


def test_the_limits_of_a_point_are_as_contributing_says():
    form = r'may use (\d+) s of CPU and (\d+) s of the clock.* all others together have (\d+) s'
    said = [int(seconds) for seconds in re.search(form, CONTRIBUTING, re.DOTALL).groups()]
    assert said == [tasks.CPU_LIMIT_S, tasks.LIMIT_S, tasks.TOGETHER_S]


def test_packages_with_copyleft_are_named():
    locks = ''.join((ROOT / 'tools/locks' / lock).read_text() for lock in LOCKS)
    names = re.findall(r'^([a-z][\w-]*)==', locks, re.M)
    form = r'GPL|GENERAL PUBLIC|\bMPL|Mozilla|\bEPL'
    copyleft = {name for name in names if re.search(form, licence(name))}
    said = re.search(r'stay beside the package\. (.*?) have copyleft', ENVIRONMENT, re.S)[1]
    # empy names its licence in its source only; docutils has a file under GPL, but not its wheel.
    assert set(re.findall(r'`([^`]+)`', said)) - {'empy'} == copyleft - {'docutils'}


def test_pyproject_asks_for_each_package_that_is_imported():
    """Beside the messages of ROS, which rclpy brings."""
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))
    asked = [
        *project['project']['dependencies'],
        *project['project']['optional-dependencies']['ros'],
        *(words for group in project['dependency-groups'].values() for words in group),
    ]
    asked = {re.split(r'[^\w-]', words)[0] for words in asked}
    imported = set()
    for room in ('helpers', 'classroom', 'tools', 'tests'):
        for path in (ROOT / room).rglob('*.py'):
            imported |= imported_packages(path.read_text(encoding='utf-8'))
    brought = packages_distributions()
    # Where two distributions bring a package, as wheels of ROS do, either may be asked for.
    needed = {
        tuple(sorted({name.lower().replace('_', '-') for name in brought[module]}))
        for module in imported & brought.keys()
    }
    missing = [names for names in needed if not asked.intersection(names)]
    assert sorted(names for names in missing if not any(n.startswith('ros-') for n in names)) == []
