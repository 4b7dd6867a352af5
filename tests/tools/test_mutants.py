"""The rules of wrong answers make those that they say, each once, and enough for each task."""

import ast
from textwrap import dedent

import pytest
from mutants import drawn, entry_of, mutants_of, same_program
from mutants.lessons import of_lesson
from support.answers import LEAST, answers_of, equal_of, source_of

from helpers.lesson import ROOT, lessons


def program(text):
    """Return a source without the indentation that it has in this file."""
    return dedent(text).strip('\n')


def made_by(rule, solution, starter=''):
    """Return the sources that a rule makes of a solution."""
    return [one.source for one in mutants_of(solution, [starter]) if one.rule == rule]


def assert_makes(rule, solution, *wrong):
    """Assert that a rule makes these programs, among others."""
    sources = made_by(rule, program(solution))
    for text in wrong:
        assert any(same_program(source, program(text)) for source in sources), sources


LOCKED = """
    with lock:
        a = f()
        b = a
    """
CAUGHT = """
    def run():
        try:
            spin()
        finally:
            stop()
    """
# A rule, a solution, and wrong answers that it makes of it.
EXAMPLES = [
    (
        'out_of_a_block',
        LOCKED,
        'a = f()\nwith lock:\n    b = a',
        'with lock:\n    a = f()\nb = a',
    ),
    ('without_its_block', LOCKED, 'a = f()\nb = a'),
    ('without_its_block', CAUGHT, 'def run():\n    spin()'),
    ('behind_the_next_one', 'work()\ndone.set()', 'done.set()\nwork()'),
    (
        'before_its_work',
        'def job():\n    one()\n    two()\n    done.set()',
        'def job():\n    done.set()\n    one()\n    two()',
    ),
    (
        'a_return_too_early',
        'def f():\n    for x in xs:\n        g(x)\n    return x',
        'def f():\n    for x in xs:\n        g(x)\n        return x',
    ),
    (
        'an_except_in_place_of_finally',
        CAUGHT,
        'def run():\n    try:\n        spin()\n    except KeyboardInterrupt:\n        stop()',
    ),
    ('behind_the_try', CAUGHT, 'def run():\n    spin()\n    stop()'),
    (
        'behind_the_finally',
        'try:\n    f()\nfinally:\n    stop()\n    shutdown()',
        'try:\n    f()\nfinally:\n    stop()\nshutdown()',
    ),
    (
        'a_spin_in_place_of_a_loop',
        'while rclpy.ok():\n    rclpy.spin_once(node, timeout_sec=0.1)',
        'rclpy.spin(node)',
    ),
    (
        'other_errors',
        'try:\n    f()\nexcept (A, B):\n    stop()',
        'try:\n    f()\nexcept A:\n    stop()',
        'try:\n    f()\nexcept (A, B):\n    pass',
        'try:\n    f()\nexcept BaseException:\n    stop()',
    ),
    (
        'without_super',
        """
        def on_activate(self, state):
            return super().on_activate(state)
        """,
        """
        def on_activate(self, state):
            return TransitionCallbackReturn.SUCCESS
        """,
    ),
    (
        'a_loop_in_place_of_a_timer',
        'self.timer = self.create_timer(0.1, self.tick)',
        'self.timer = None\nself.tick()',
        """
        self.timer = None
        import time
        for _ in range(50):
            self.tick()
            time.sleep(0.1)
        """,
    ),
    ('a_busy_loop_in_place_of_a_wait', 'e.wait(timeout=5)', 'while not e.is_set(): pass'),
    (
        'a_busy_loop_in_place_of_a_wait',
        'time.sleep(0.2)',
        'end = time.monotonic() + 0.2\nwhile time.monotonic() < end: pass',
    ),
    ('a_sleep_in_place_of_a_wait', 'x = e.wait(5)', "x = __import__('time').sleep(0.3)"),
    (
        'a_number_of_rounds_in_place_of_a_time',
        'while time.monotonic() < end:\n    spin_once()',
        'for _ in range(20):\n    spin_once()',
    ),
    (
        'a_lock_around_one_half',
        'with self.lock:\n    self.count += 1',
        'with self.lock:\n    known = self.count\nwith self.lock:\n    self.count = known + 1',
        'known = self.count\nwith self.lock:\n    self.count = known + 1',
        'with self.lock:\n    known = self.count\nself.count = known + 1',
    ),
    (
        'a_lock_around_one_half',
        'with self.lock:\n    if not self.busy:\n        self.busy = True',
        'with self.lock:\n    known = not self.busy\nif known:\n    self.busy = True',
    ),
    (
        'a_lock_of_ones_own',
        'with self.lock:\n    f()',
        "with __import__('threading').Lock():\n    f()",
    ),
    (
        'another_executor',
        'x = MultiThreadedExecutor(num_threads=2)',
        'x = MultiThreadedExecutor()',
        'x = SingleThreadedExecutor()',
    ),
    (
        'another_group',
        'a = MutuallyExclusiveCallbackGroup()\nb = MutuallyExclusiveCallbackGroup()',
        'a = MutuallyExclusiveCallbackGroup()\nb = a',
        'a = ReentrantCallbackGroup()\nb = MutuallyExclusiveCallbackGroup()',
    ),
    (
        'a_local_name',
        'class A:\n    def __init__(self):\n        self.x = f()',
        'class A:\n    def __init__(self):\n        x = f()',
    ),
    (
        'an_attribute_of_the_class',
        'class A:\n    def __init__(self):\n        f()\n        self.x = []',
        'class A:\n    x = []\n    def __init__(self):\n        f()',
    ),
    ('twice', 'publish(x)', 'publish(x)\npublish(x)'),
    ('the_first_only', 'for x in xs:\n    f(x)', 'for x in list(xs)[:1]:\n    f(x)'),
    ('the_first_only', 'y = [f(x) for x in xs]', 'y = [f(x) for x in list(xs)[:1]]'),
    ('the_first_only', 'while x:\n    f()', 'if x:\n    f()'),
    ('the_other_end', 'x = a[-1]', 'x = a[0]'),
    ('the_other_end', 'x = a.pop(0)', 'x = a.pop()'),
    ('the_other_end', 'a.append(x)', 'a.insert(0, x)', 'a[:] = [x]'),
    (
        'keeps_the_first',
        'class A:\n    def on(self, m):\n        self.x = m',
        "class A:\n    def on(self, m):\n        if not getattr(self, 'x', None):\n"
        '            self.x = m',
    ),
    (
        'stays_in_the_method',
        'class A:\n    def on(self, m):\n        self.x = m',
        'class A:\n    def on(self, m):\n        x = m',
    ),
    ('another_clock', 'x = time.monotonic()', 'x = time.time()'),
    ('another_clock', 'x = m.header.stamp', 'x = node.get_clock().now().to_msg()'),
    ('whole_seconds', 'x = age.nanoseconds / 1e9', 'x = int(age.nanoseconds / 1e9)'),
    ('whole_seconds', 'x = s.sec + s.nanosec / 1e9', 'x = s.sec'),
    (
        'a_value_that_is_kept',
        "class A:\n    def on(self):\n        x = self.get_parameter('v').value",
        'class A:\n    def on(self):\n        x = vars(self).setdefault('
        "'_kept_get_parameter', self.get_parameter('v').value)",
    ),
    ('the_text_in_place_of_the_flag', 'x = answer.success', 'x = bool(answer.message)'),
    ('a_sign_that_is_lost', 'x = max(0, a - b)', 'x = abs(a - b)', 'x = a - b'),
    ('one_side_of_a_range', 'x = -1 <= a <= 2', 'x = -1 <= a', 'x = a <= 2'),
    ('what_is_not_a_number', 'x = not a >= b', 'x = a < b'),
    ('no_copy', 'x = list(a)', 'x = a'),
    ('not_called', 'if e.is_set():\n    f()', 'if e.is_set:\n    f()'),
    ('not_awaited', 'async def f():\n    x = await g()', 'async def f():\n    x = g()'),
    ('logged_once', "self.get_logger().info('x')", "self.get_logger().info('x', once=True)"),
    ('a_depth_for_a_profile', 'x = QoSProfile(depth=1)', 'x = 10'),
    (
        'a_depth_for_a_profile',
        "node.create_subscription(T, 't', f, LASER)",
        "node.create_subscription(T, 't', f, 10)",
    ),
    ('a_conversion_gone', 'x = math.radians(a)', 'x = a'),
    ('a_function_gone', 'def f():\n    pass\n\n\ndef g():\n    f()', 'def g():\n    f()'),
    ('forgets_to_give_back', 'def f():\n    return x', 'def f():\n    x'),
    ('a_statement_gone', 'f()\ng()', 'g()', 'f()'),
    ('one_half_of_a_condition', 'x = a and b', 'x = a', 'x = b', 'x = a or b'),
    ('another_argument', 'f(a, timeout=5)', 'f(a)'),
    ('another_argument', 'f(a, b)', 'f(b, a)'),
]


@pytest.mark.parametrize(('rule', 'solution', 'wrong'), [(*one[:2], one[2:]) for one in EXAMPLES])
def test_a_rule_makes_these_mistakes(rule, solution, wrong):
    assert_makes(rule, solution, *wrong)


@pytest.mark.parametrize(
    'solution',
    [
        'def f(m):\n    if m.status < m.FIX:\n        return []\n    x = m.place\n    return x',
        'def f(m):\n    return m.status < NavSatStatus.STATUS_FIX',
        'def __init__(self, work):\n    super().__init__("a")\n    self.work = work',
    ],
)
def test_what_is_as_good_is_no_mistake(solution):
    for rule in ('behind_the_next_one', 'what_is_not_a_number', 'twice'):
        assert not made_by(rule, solution)


def test_a_timer_repeats_what_came_last():
    source = (
        "class A:\n    def __init__(self):\n        self.create_subscription(T, 't', self.on, 1)"
    )
    [made] = made_by('a_timer_that_repeats', source)
    assert 'self.create_timer(0.05' in made
    ast.parse(made)


FILES = [
    ('%%write package.xml', '<exec_depend>rclpy</exec_depend>', '<test_depend>rclpy</test_depend>'),
    ('%%write a.yaml', 'a:\n  speed: 0.5', 'a:\nspeed: 0.5'),
    ('%%write a.yaml', 'a:\n  speed: 0.5', 'a:\n  speed: 1.5'),
    ('%%write CMakeLists.txt', 'find_package(a REQUIRED)\nx(b)', 'x(b)'),
    ('%%write CMakeLists.txt', 'install(TARGETS a EXPORT b)', 'install(TARGETS a EXPORT)'),
    ('%%write a.cpp', 'if (a && b) {\n  f();\n}', 'if (a) {\n  f();\n}'),
    ('%%write a.cpp', 'if (a) {\n  f();\n}', 'if (a) {\n}\n  f();'),
    ('%%write a.cpp', '  timer_ = create_timer(x);', '  auto local = create_timer(x);'),
    ('%%write a.launch.xml', '<node pkg="a" exec="b"/>\n<node/>', '<node exec="b"/>\n<node/>'),
    ('%%write a.srv', 'float64 x\n---\nbool y', 'float32 x\n---\nbool y'),
    ('%%terminal', 'colcon build', 'cd src; colcon build'),
    ('%%terminal', 'cd src\ngit clone -b x y', 'git clone -b x y'),
    ('%%terminal', 'colcon build --packages-up-to x', 'colcon build --packages-up-to'),
    ('%%terminal', 'colcon build --packages-up-to x', 'colcon build --packages-select x'),
]


@pytest.mark.parametrize(('magic', 'solution', 'wrong'), FILES)
def test_files_have_mistakes_in_their_lines(magic, solution, wrong):
    sources = [one.source for one in mutants_of(f'{magic}\n{solution}', [])]
    assert f'{magic}\n{wrong}' in sources, sources


@pytest.mark.parametrize(
    ('magic', 'solution', 'equal'),
    [
        ('%%write a.cpp', '  best = a;\n  widest = b;', '  widest = b;\n  best = a;'),
        ('%%write a.cpp', '  best = a;\n  f(best);', '  best = a;\n  best = a;\n  f(best);'),
        (
            '%%write CMakeLists.txt',
            'find_package(a REQUIRED)\nfind_package(b REQUIRED)',
            'find_package(b REQUIRED)\nfind_package(a REQUIRED)',
        ),
    ],
)
def test_files_have_no_mistakes_that_are_none(magic, solution, equal):
    sources = [one.source for one in mutants_of(f'{magic}\n{solution}', [])]
    assert sources
    assert f'{magic}\n{equal}' not in sources


def test_a_text_in_a_program_is_a_file_too():
    sources = [one.source for one in mutants_of('RULES = """\na: b\nc: d\n"""', [])]
    assert 'RULES = """\na: b\n"""' in sources


def test_only_what_the_learner_writes_has_mistakes():
    solution = 'given(1, 2)\nown = 3'
    differences = [one.difference for one in mutants_of(solution, ['given(1, 2)\nown = ...'])]
    assert differences
    assert not [one for one in differences if '-given' in one]
    assert not mutants_of('given(1, 2)', ['# given(1, 2)\n...']), 'the comment gives the line'


def test_each_mutant_is_another_program_and_can_be_compiled():
    solution = 'def f(x):\n    if not x >= 1:\n        return x\n    return max(0, x)'
    programs = [ast.dump(ast.parse(one.source)) for one in mutants_of(solution, [])]
    assert len({*programs, ast.dump(ast.parse(solution))}) == len(programs) + 1


def test_comments_and_other_lines_stay():
    solution = 'a = f()  # because\n\n\nwith lock:  # held\n    b = g()\n    c = h()'
    for source in made_by('out_of_a_block', solution):
        assert 'a = f()  # because\n' in source
        assert 'with lock:  # held\n' in source


def test_parts_of_files_and_commands_in_programs_are_read():
    part = '%%write a.py part 2\n    def on(self):\n        work()\n        done.set()'
    assert any(one.rule == 'behind_the_next_one' for one in mutants_of(part, []))
    commands = 'with session:\n    f()\n    !ros2 topic list'
    sources = [one.source for one in mutants_of(commands, [])]
    assert 'with session:\n    f()\n!ros2 topic list' in sources


def test_an_id_stays_when_other_lines_change():
    one, other = ('a = 1\nb = 2\nc = 3\nx = f()\ng()', 'a = 7\nb = 2\nc = 3\nx = f()\ng()')
    ids = [
        {m.id for m in mutants_of(source, []) if '-g()' in m.difference} for source in (one, other)
    ]
    assert ids[0] == ids[1] != set()


def test_the_same_seed_draws_the_same():
    mutants = [*range(100)]
    assert drawn(mutants, 5, 7) == drawn(mutants, 5, 7) != drawn(mutants, 5, 8)
    assert drawn(mutants, 5, 7) == sorted(drawn(mutants, 5, 7))
    assert drawn(mutants, None, 7) == mutants


def test_an_entry_makes_its_mutant():
    solution = 'class A:\n    def on(self, m):\n        with self.lock:\n            self.n += m\n'
    solution += '            self.far = max(self.far, m)\n        self.done.append(m)'
    for mutant in mutants_of(solution, []):
        old, new = entry_of(mutant)
        assert same_program(source_of({old: new}, solution), mutant.source)


def test_an_equal_mutant_needs_a_reason():
    assert equal_of({'a equal': [{'x': 'y', 'because': 'z'}]}, 'a') == [({'x': 'y'}, 'z')]
    assert equal_of({}, 'a') == []
    with pytest.raises(ValueError, match='because'):
        equal_of({'a equal': [{'x': 'y'}]}, 'a')


@pytest.mark.parametrize('lesson', lessons(), ids=lambda lesson: lesson.file)
def test_answers_and_the_rules_of_wrong_ones_fit_together(lesson):
    file = ROOT / f'tests/answers/{lesson.name}.yaml'
    if not lesson.tasks:
        return
    answers, of_tasks = answers_of(file), of_lesson(lesson.name)
    stale = [f'{task}: {old}' for task, of in of_tasks.items() for old in of.stale]
    assert not stale, f'No rule makes these any more, below `equal:` of {file.name}: {stale}'
    for task, of in of_tasks.items():
        known = '\n\n'.join(of.known)
        assert not known, f'{task}: take out of {file.name} what a rule makes as well:\n{known}'
    found = {
        task: len(answers.get(f'{task} wrong', [])) + len(of.mutants)
        for task, of in of_tasks.items()
    }
    few = {task: number for task, number in found.items() if number < LEAST['wrong']}
    assert not few, f'There must be {LEAST["wrong"]} wrong answers, with those of rules: {few}'
