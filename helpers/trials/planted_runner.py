"""Runs tests with several versions of a module, each in a process of its own, all at once.

A script for `planted.py`, which starts it in the workspace. It imports nothing of helpers, since
the tests must run as they would on a robot. Its one argument names a JSON file:

    {"path": "src/brake_pkg", "module": "brake_pkg.brake", "arguments": ["-x", "test_brake.py"],
     "versions": {"right": {"source": "class Brake...", "keyword": ""}, ...}}

A version with a source replaces the module; a keyword chooses tests, as pytest's -k. The last line
that it prints is the result of each version, as JSON: how many tests passed, and which failed.
"""

import time

START = time.monotonic()

import faulthandler  # noqa: E402
import io  # noqa: E402
import json  # noqa: E402
import multiprocessing  # noqa: E402
import os  # noqa: E402
import re  # noqa: E402
import signal  # noqa: E402
import sys  # noqa: E402
import types  # noqa: E402
from contextlib import redirect_stdout  # noqa: E402

# Slow imports, before the processes fork. numpy and rclpy are here for the tests.
import numpy  # noqa: E402, F401
import pytest  # noqa: E402
import rclpy  # noqa: E402, F401

POLL_S, WRITES_S = 0.02, 2.0  # until a process has written where it is
MOST_WRITTEN = 100_000
PLACE = re.compile(r'File "(.*?)", line (\d+)')  # of faulthandler, the innermost first


class Reports:
    """A plugin of pytest that keeps what passed and what failed, and says which test begins."""

    def __init__(self, answer):
        self.answer = answer
        self.passed, self.failed, self.problems = 0, [], []

    def pytest_runtest_logstart(self, nodeid):
        """Say which test begins: it may not come back."""
        self.answer.send(_name(nodeid))

    def pytest_runtest_logreport(self, report):
        """Count a test that passed, and keep where one failed: in itself or in a fixture."""
        if report.when == 'call' and report.passed:
            self.passed += 1
        if report.failed:
            file, line, message = _place_and_message(report)
            entries = getattr(getattr(report.longrepr, 'reprtraceback', None), 'reprentries', [])
            places = [getattr(entry, 'reprfileloc', None) for entry in reversed(entries)]
            self.failed.append(
                {
                    'test': _name(report.nodeid),
                    'ran': report.when == 'call',
                    'file': file,
                    'line': line,
                    'message': message,
                    'places': [(place.path, place.lineno) for place in places if place],
                }
            )

    def pytest_collectreport(self, report):
        """Keep why a file cannot be read."""
        if report.failed:
            self.problems.append(str(report.longrepr))


def _name(nodeid):
    return nodeid.partition('::')[2] or nodeid


def _place_and_message(report):
    """Return the file and the line where a test failed, and why."""
    problem = report.longrepr
    if hasattr(problem, 'argname'):  # an argument of the test is no fixture
        return str(problem.filename), problem.firstlineno + 1, problem.errorstring.strip()
    crash = getattr(problem, 'reprcrash', None)
    place = _entry_of_the_test(report) or crash
    message = crash.message if crash else str(problem)
    return str(getattr(place, 'path', '')), getattr(place, 'lineno', 0), message


def _entry_of_the_test(report):
    """Return the place in the test file at which the test failed, and not in what it called."""
    traceback = getattr(report.longrepr, 'reprtraceback', None)
    file = report.nodeid.partition('::')[0].rpartition('/')[2]
    for entry in reversed(getattr(traceback, 'reprentries', [])):
        place = getattr(entry, 'reprfileloc', None)
        if place and place.path.endswith(file):
            return place
    return None


def run(version, module, arguments, path, answer, places):
    """Run the tests with one version, and send what came out. SIGUSR1 writes where it is."""
    faulthandler.register(signal.SIGUSR1, file=places, all_threads=False)
    sys.path.insert(0, path)
    if version['source']:
        sys.modules[module] = types.ModuleType(module)
        exec(version['source'], sys.modules[module].__dict__)
    keyword = ['-k', version['keyword']] if version['keyword'] else []
    reports = Reports(answer)
    with redirect_stdout(io.StringIO()):
        code = pytest.main(
            ['-q', '-p', 'no:cacheprovider', *keyword, *arguments], plugins=[reports]
        )
    answer.send(
        {
            'code': int(code),
            'passed': reports.passed,
            'failed': reports.failed,
            'problems': reports.problems,
        }
    )


def result_of(process, answer, places, end):
    """Return the result of a process, or which test had begun when there was none, and where."""
    test = ''
    try:
        while answer.poll(max(0, end - time.monotonic())):
            message = answer.recv()
            if isinstance(message, dict):
                return message
            test = message
    except EOFError:
        return {'code': -2, 'test': test}
    os.kill(process.pid, signal.SIGUSR1)
    written, limit = '', time.monotonic() + WRITES_S
    while not written and time.monotonic() < limit:
        time.sleep(POLL_S)
        written = os.pread(places, MOST_WRITTEN, 0).decode()
    return {'code': -1, 'test': test, 'places': PLACE.findall(written)}


def main():
    """Run all versions, and print the results."""
    del sys.path[0]  # the folder of this script
    with open(sys.argv[1]) as file:
        task = json.load(file)
    # Longer on a busy computer.
    end = time.monotonic() + min(45, 9 + 12 * (time.monotonic() - START))
    fork = multiprocessing.get_context('fork')
    running = []
    for name, version in task['versions'].items():
        here, there = fork.Pipe(duplex=False)
        places = os.memfd_create('places')
        arguments = version, task['module'], task['arguments'], task['path'], there, places
        process = fork.Process(target=run, args=arguments)
        process.start()
        there.close()
        running.append((name, process, here, places))
    results = {}
    for name, process, answer, places in running:
        results[name] = result_of(process, answer, places, end)
        process.kill()
        process.join()
    print(json.dumps(results))


if __name__ == '__main__':
    main()
