"""What a student's code does in the kernel that judges it, as a witness sees it who is not there.

The code of a student runs in the process that judges it, so it may change what judges, and what
says the verdict. This file runs in the kernel before any of that code, in a namespace that belongs
to no module. It stays there as an audit hook (https://peps.python.org/pep-0578/), which nothing in
Python can remove. It writes into a pipe of `judge`, and each line has a code that only the two can
make:

    point     a check has judged a point: whether it is right. The line is written only if the frame
              that asks is that of the real `judge_points`, with a judge that is as it was
    changed   a function, a class or a constant is not what it was before: of what judges, of
              IPython, of ROS, of the standard library
    did       the code of the student has itself done something that no answer needs, such as
              `gc.get_objects`, or has opened a file of this course's solutions
    heard     an order of `judge`: what follows is code of the student, or a check

A verdict counts only if the points are those of this pipe. A line that is missing, or has another
code, is told as well. This file imports nothing that a student could have changed before: it is the
first that runs.
"""

# ruff: noqa: E402, F821, SLF001, SIM105, S110
# KEY, PIPE, SECRET_FILES and CHECKS are put into the namespace by judge.py.
import os
import sys
from _blake2 import blake2b
from _thread import get_ident
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType

ORDER, POINT = 'ros2_notebooks.order', 'ros2_notebooks.point'
# The modules whose functions, classes and constants stay as they are.
WATCHED = (
    *('builtins', 'sys', 'os', 'posix', 'time', 'threading', '_thread', 'math', 'operator', 're'),
    *('functools', 'inspect', 'traceback', 'linecache', 'signal', 'select', 'selectors', 'queue'),
    *('pickle', '_pickle', 'copyreg', 'json', 'struct', 'tempfile', 'resource', 'faulthandler'),
    *('numpy', 'psutil', 'subprocess', 'contextlib', 'dataclasses', 'types', 'numbers'),
)
BELOW = (
    *('helpers', 'IPython', 'ipykernel', 'jupyter_client', 'multiprocessing'),
    *('rclpy', 'std_msgs', 'geometry_msgs', 'sensor_msgs', 'nav_msgs', 'builtin_interfaces'),
    *('std_srvs', 'example_interfaces', 'rcl_interfaces', 'action_msgs', 'ros2_command'),
)
# Others put theirs in place: IPython, a worker, a library at its first use.
MAY_CHANGE = {
    *('builtins.__build_class__', 'builtins.display', 'builtins._', 'builtins.get_ipython'),
    *('builtins.exit', 'builtins.quit', 'builtins.input', 'builtins.print', 'builtins.open'),
    *('builtins.__import__', 'threading.excepthook', 'builtins.__debugger__'),
    *('sys.excepthook', 'sys.displayhook', 'sys.breakpointhook', 'sys.unraisablehook'),
}
# What no answer needs. It is told if the code of the student calls it by itself.
BY_ITSELF = {
    *('sys._getframe', 'sys._current_frames', 'sys._current_exceptions', 'gc.get_objects'),
    *('gc.get_referrers', 'gc.get_referents', 'object.__setattr__', 'object.__delattr__'),
    *('code.__new__', 'function.__new__', 'exec', 'compile', 'sys.settrace', 'sys.setprofile'),
    *('sys.addaudithook', 'ctypes.dlopen', 'ctypes.dlsym', 'ctypes.cdata', 'ctypes.addressof'),
    *('ctypes.string_at', 'ctypes.cdata/buffer', 'ctypes.call_function', 'ctypes.dlsym/handle'),
    *('marshal.loads', 'pickle.find_class', 'os.fork', 'os.forkpty', 'os.putenv', 'os.unsetenv'),
    *('os.kill', 'os.exec', 'os.posix_spawn', 'os.system', 'mmap.__new__'),
}
ON_ITS_BEHALF = ('/inspect.py', '/code.py', '/codeop.py', '/timeit.py', '/runpy.py', '/pdb.py')
MOST = 40  # things that are told
PLAIN = (int, float, str, bool, bytes, type(None), tuple, frozenset)

getframe, audit, write, getpid = sys._getframe, sys.audit, os.write, os.getpid
modules = sys.modules
pipe = os.open(PIPE, os.O_WRONLY)
students = set()  # files of code of the student
known = {}  # what is watched: (module, path) and the value
judges = {}  # a task, its judge and the judge's function
seen, busy = set(), set()
state = {'mode': '', 'orders': 0, 'points': 0}


def tell(*words):
    text = repr((getpid(), *words))
    code = blake2b(text.encode(errors='replace'), key=KEY, digest_size=16).hexdigest()
    write(pipe, f'{code} {text}\n'.encode(errors='replace')[:4000])


def told_once(*words):
    if words not in seen and len(seen) < MOST:
        seen.add(words)
        tell(*words)


# --- What has changed -----------------------------------------------------------------------------


def is_watched(name):
    return name in WATCHED or name.partition('.')[0] in BELOW


def parts(function):
    """Return what a function consists of: its code, its defaults, and the functions it holds."""
    held = []
    for cell in function.__closure__ or ():
        try:
            value = cell.cell_contents
        except ValueError:
            continue
        held.append(value if type(value) is FunctionType else None)
    return (function.__code__, function.__defaults__, function.__kwdefaults__, *held)


def same(one, other):
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))


def know(name, module):
    for key, value in list(module.__dict__.items()):
        if type(key) is not str or f'{name}.{key}' in MAY_CHANGE:
            continue
        if type(value) in (FunctionType, BuiltinFunctionType, ModuleType) or isinstance(
            value, type
        ):
            known[name, key] = value, parts(value) if type(value) is FunctionType else None
        elif type(value) in PLAIN and name.startswith(CHECKS) and not key.startswith('_'):
            known[name, key] = value, None
        if isinstance(value, type) and getattr(value, '__module__', '') == name:
            for inner, found in list(value.__dict__.items()):
                if type(found) in (FunctionType, property, classmethod, staticmethod):
                    whole = parts(found) if type(found) is FunctionType else None
                    known[name, f'{key}.{inner}'] = found, whole


def know_all():
    for name, module in list(modules.items()):
        if type(module) is ModuleType and is_watched(name) and (name, '') not in known:
            known[name, ''] = module, None
            know(name, module)
    for tasks in list(getattr(modules.get(CHECKS + 'lessons.' + LESSON), '__dict__', {}).values()):
        if type(tasks).__name__ == 'Tasks':
            for task, judge in tasks.judges.items():
                judges.setdefault(task, (judge, judge.function, tasks))


def find(name, path):
    found = modules.get(name)
    for word in path.split('.') if path else ():
        found = found.__dict__.get(word) if isinstance(found, type | ModuleType) else None
    return found


def change():
    """Return the name of something that is not as it was, or nothing."""
    for (name, path), (value, whole) in known.items():
        found = find(name, path)
        if found is not value or whole is not None and not same(parts(found), whole):
            return f'{name}.{path}'.rstrip('.')
    for task, (judge, function, tasks) in judges.items():
        if tasks.judges.get(task) is not judge or judge.function is not function:
            return f'the judge of {task}'
    return ''


# --- What happens ---------------------------------------------------------------------------------


def frame_of_student(frame):
    """Return whether code of the student does this by itself, or lets another module do it."""
    while frame is not None and frame.f_code.co_filename.endswith(ON_ITS_BEHALF):
        frame = frame.f_back
    return frame is not None and frame.f_code.co_filename in students


def student_is_above(frame):
    while frame is not None:
        if frame.f_code.co_filename in students:
            return True
        frame = frame.f_back
    return False


def obey(arguments):
    """Take an order of `judge`, which knows the secret, and answer it."""
    code, mode = arguments
    state['orders'] += 1
    right = blake2b(f'{state["orders"]} {mode}'.encode(), key=KEY, digest_size=16).hexdigest()
    if code != right:
        state['orders'] -= 1
        told_once('did', 'an order in the place of what judges')
        return
    if mode == 'know':
        know_all()
    state['mode'] = mode
    tell('heard', state['orders'], mode, change())


def point(arguments, frame):
    """Tell that a check has judged a point, if it is the real one with the real judge."""
    what, ok = arguments
    points = frame.f_locals.get('points') if frame.f_code is REAL_POINTS else None
    inside = type(points) is FunctionType and points.__code__
    if inside and any(inside is one for one in REAL_SOLUTION.co_consts):
        return  # a solution of the lesson: it counts for nobody
    if not inside or not any(inside is one for one in REAL_CHECK.co_consts):
        told_once('did', 'a point in the place of its check')
        return
    cells = dict(zip(points.__code__.co_freevars, points.__closure__ or (), strict=False))
    judge = cells['judge'].cell_contents
    task = next((name for name, (one, *_) in judges.items() if one is judge), '')
    tell('point', task, what, ok, change())


def hook(event, arguments):
    if type(event) is not str:
        return
    here = get_ident()
    if here in busy:
        return
    if event in BY_ITSELF:
        busy.add(here)
        try:
            frame = getframe(1)
            if event == 'compile' and state['mode'] == 'student':
                source, file = arguments[:2]
                if type(file) is str and '/ipykernel_' in file:
                    students.add(file)
            if frame_of_student(frame):
                if event == 'compile' and type(arguments[1]) is str:
                    students.add(arguments[1])
                told_once('did', event)
        except BaseException:
            pass
        finally:
            busy.discard(here)
    elif event == 'open':
        path = arguments[0]
        if type(path) is bytes:
            path = path.decode(errors='replace')
        if type(path) is str and any(word in path for word in SECRET_FILES):
            busy.add(here)
            try:
                if student_is_above(getframe(1)):
                    told_once('did', 'open ' + path[-80:])
            except BaseException:
                pass
            finally:
                busy.discard(here)
    elif event in (ORDER, POINT):
        busy.add(here)
        try:
            if all(type(one) in (str, bool) for one in arguments) and len(arguments) == 2:
                obey(arguments) if event == ORDER else point(arguments, getframe(1))
        except BaseException:
            pass
        finally:
            busy.discard(here)


from helpers.checks.points import judge_points
from helpers.checks.tasks import Tasks

REAL_POINTS: CodeType = judge_points.__code__
REAL_CHECK: CodeType = Tasks.check.__code__
REAL_SOLUTION: CodeType = Tasks.run_solution.__code__
sys.addaudithook(hook)
