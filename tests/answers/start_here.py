"""Answers to the task of lesson 00, as students give them: the check must judge all right."""

ANSWERS = {
    1: {
        'wrong': [
            'speed = 0.3\n',
            'speed = 1.75\n',
            'speed = 3.5 / 1.75\n',
            'speed = -0.5\n',
            "speed = '0.5 m/s'\n",
            'speed = 0,5\n',
            'speed = ...\n',
            'speeds = 0.5\n',
        ],
        'right': [
            'speed = 0.5\n',
            'speed = 1.75 / 3.5\n',
            'distance_m, time_s = 1.75, 3.5\nspeed = distance_m / time_s\n',
            'speed = 0.45\n',
        ],
    },
}
