"""One colour language for the whole recording (RGB): blue is what happened, amber is what was planned."""

MEASURED = (60, 140, 255)
PLANNED = (255, 165, 40)
LEFT = (175, 95, 230)
RIGHT = (35, 180, 145)
LIMIT = (140, 140, 150)
FAULT = (225, 55, 55)
GOOD = (70, 175, 90)
AXES = ((230, 90, 80), (95, 190, 90), (80, 130, 240))  # x, y, z
PALE_AXES = ((250, 185, 180), (180, 235, 175), (175, 200, 255))  # the same, planned

# One newton is this many metres of arrow: a 35 N robot's weight is about its own leg.
METRES_PER_NEWTON = 0.008
