"""A floor of the student's own."""

from helpers.checks.lessons.put_a_program_on_a_robot.shared import tasks
from helpers.checks.patrols import comes_to_each_place
from helpers.checks.points import cached
from helpers.patrol import PACKAGE, Tour, round_tour, route_of
from helpers.robot import Floor
from helpers.ros import ros_session


@tasks.add(limit_s=120, cpu_s=60)
def a_floor_of_your_own(workspace, file):
    path = workspace.file(f'{PACKAGE}/{file}')

    @cached
    def floor():
        return Floor.from_text(path.read_text(encoding='utf-8'), name=path.stem)

    @cached
    def robot():
        tour, _ = round_tour(workspace, floor(), path.stem)
        return tour.robot

    def hits_nothing():
        x, y, _ = robot().pose
        return not robot().bumps or f'it hits something at {x:.1f}, {y:.1f}'

    def comes_everywhere():
        if not floor().places:
            return 'the floor has no place with a letter'
        return comes_to_each_place(robot())

    def stands_after(trouble):
        route = route_of(path.with_suffix('.yaml'))
        with ros_session():
            numbers = [float(number) for place in route for number in place]
            tour = Tour(workspace, floor=floor(), route=numbers)
            tour.run(1)
            if any(v or w for v, w in tour.speeds(0.2)):
                return 'without a goal it drives'
            tour.send(len(route))
            tour.run(1)
            if trouble == 'a cancel':
                tour.handle.cancel_goal_async()
            else:
                tour.robot.blind = True
            tour.run(1.5)
            end = tour.robot.record.poses[-1]
        if end.v:
            return f'after {trouble} it drives on'
        return end.w == 0 or f'after {trouble} it turns'

    hint = 'More places on the route, or a floor with more space.'
    return [
        ('it hits nothing', hits_nothing, hint),
        ('it comes to each place with a letter', comes_everywhere, 'x and y from the start'),
        (
            'it stands without a goal, and after a cancel',
            lambda: stands_after('a cancel'),
            'job.place()',
        ),
        (
            'it stands if the laser is blind',
            lambda: stands_after('a blind laser'),
            'steer(*beams(scan), ...)',
        ),
    ]
