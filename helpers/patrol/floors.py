"""Floors for the program, and the route on the largest."""

from helpers.patrol.program import PACKAGE
from helpers.robot import Floor
from helpers.workspace import Workspace

LAST = Floor.from_text(
    """
##########
#        #
# >  o A #
#    o   #
##########
""",
    name='two boxes',
)
CLOSE = Floor.from_text(
    """
######
#    #
# >  #
#    #
######
""",
    name='close to a wall',
)
CELLAR = Floor.from_text(
    """
###########################
#        #       #        #
#  A   o #   o   #  o  B  #
#                #        #
#    o   #   o            #
#        #       #    o   #
####  #########  ####  ####
#        #       #        #
#   o    #  o    #   o    #
# >              #        #
#     o  #   C   #   D    #
#        #       #        #
###########################
""",
    name='cellar',
)
ON_THE_WAY = [(4.75, 1.75), (6.75, 1.25), (8.0, 2.75), (8.0, 3.75), (9.5, 4.25), (11.75, 5.25)]
ON_THE_WAY += [(10.75, 4.0), (10.75, 2.75), (10.75, 1.25), (10.75, 2.75), (10.75, 4.0)]
ON_THE_WAY += [(9.5, 4.25), (8.0, 4.75), (4.75, 4.75), (1.75, 5.25)]


def write_route_of_cellar(workspace: Workspace) -> None:
    """Write the parameter file of the other floor."""
    x0, y0, _ = CELLAR.start
    route = [float(number) for x, y in ON_THE_WAY for number in (x - x0, y - y0)]
    workspace.write(
        f'{PACKAGE}/config/cellar.yaml',
        f'patrol:\n  ros__parameters:\n    route: {route}\n',
    )
