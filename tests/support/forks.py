"""Begin programs below `helpers.waits` at once: forks of a process that has imported ROS already.

It reads lines `PROGRAM DOMAIN OUTPUT` from stdin, and prints the process ID of each. What a program
says when it is asked ends with its circle as JSON.
"""

import json
import os
import signal
import sys

import rclpy.action
import std_msgs.msg
import std_srvs.srv
import test_msgs.action

import helpers.waits.__main__ as waits
from helpers.waits import NOTHING, tell

LOADED = rclpy.action, std_msgs.msg, std_srvs.srv, test_msgs.action


def say():
    told = tell()
    print(told.text or NOTHING, f'Circle: {json.dumps(told.circle)}', sep='\n', flush=True)


waits.what_to_say = lambda: say
program = None
signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for them
for line in sys.stdin:
    words = line.split()
    pid = os.fork()
    if pid == 0:
        program, os.environ['ROS_DOMAIN_ID'], output = words
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        file = os.open(output, os.O_CREAT | os.O_WRONLY | os.O_APPEND)
        os.dup2(file, 1)
        os.dup2(file, 2)
        break
    print(pid, flush=True)
if program:
    waits.main([program])
