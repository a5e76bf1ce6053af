"""A force read from a table over one or two coordinates: linear between the grid points, zero far outside.

A table has to be searched, so these formulas have branches and loops: they are compiled, and never bound to CasADi or
numpy. ``q``, ``v``, ``a``, ``t`` and ``h`` are position, velocity, acceleration, time and time step [SI]. ``p`` holds
scale, reversal_distance [m], then each list as its length and its entries: coordinates (numbers of ``COORDINATES``),
one grid for each coordinate but the direction in the order of ``COORDINATES``, the values [N]. ``s`` holds direction
(-1..1), travel [m], the clock of the present rest [s], the dwell [s] and the rest [s].
"""

import math

COORDINATES = ("position", "direction", "velocity", "acceleration", "load", "time", "travel", "dwell", "rest")
POSITION, DIRECTION, VELOCITY, ACCELERATION, LOAD, TIME, TRAVEL, DWELL, REST = range(9)
NUMBER_OF_GRIDS = 8  # one for each coordinate but the direction, whose grid is -1, 1
SCALARS = 2

MARGIN = 0.1  # width over which the force fades outside the grid, as a share of the grid's whole range
REST_TIME = 0.05  # s without motion after which an axis counts as resting, and within which dwell and rest follow


def learnt_map_next(v, h, s, p):
    """Advance direction, travel, clock, dwell and rest by one step; see the module for ``s`` and ``p``.

    The direction follows the motion like a slip element: it reverses over the reversal distance and stays where it
    is at rest, so that noise on a resting encoder does not move it. The axis moves where that element slips.
    """
    turned = s[0] + 2.0 * v * h / p[1]
    direction = min(max(turned, -1.0), 1.0)
    clock = 0.0 if math.fabs(turned) > 1.0 else s[2] + h
    keep = math.exp(-h / REST_TIME)
    dwell = s[3]
    if clock > REST_TIME:
        dwell = clock + (dwell + h - clock) * keep
    rest = clock + (s[4] - clock) * keep
    return (direction, s[1] + math.fabs(v) * h, clock, dwell, rest)


def coordinate(number, q, v, a, t, s):
    """Return the coordinate of this number [SI]."""
    x = q
    if number == DIRECTION:
        x = s[0]
    elif number == VELOCITY:
        x = v
    elif number == ACCELERATION:
        x = a
    elif number == LOAD:
        x = math.fabs(a)
    elif number == TIME:
        x = t
    elif number == TRAVEL:
        x = s[1]
    elif number == DWELL:
        x = s[3]
    elif number == REST:
        x = s[4]
    return x


def list_start(number, p):
    """Return where the length of a list stands in ``p``: 0 the coordinates, 1 to 8 the grids, 9 the values."""
    place = SCALARS
    for _ in range(number):
        place += 1 + int(p[place])
    return place


def grid_length(number, p):
    """Return how many grid points the coordinate of this number has."""
    if number == DIRECTION:
        return 2
    return int(p[list_start(number + 1 if number < DIRECTION else number, p)])


def between(number, x, p):
    """Return the grid point below ``x``, how far ``x`` is on the way to the next one, and what fading leaves (0..1)."""
    if not math.isfinite(x):
        return 0, 0.0, 0.0
    if number == DIRECTION:
        return 0, 0.5 + 0.5 * x, 1.0
    start = list_start(number + 1 if number < DIRECTION else number, p)
    count = int(p[start])
    first, last = p[start + 1], p[start + count]
    outside = max(first - x, x - last, 0.0) / (MARGIN * (last - first))
    fade = 0.0
    if outside < 1.0:
        fade = 1.0 - outside * outside * (3.0 - 2.0 * outside)
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x >= p[start + 1 + middle]:
            low = middle
        else:
            high = middle
    here, there = p[start + 1 + low], p[start + 2 + low]
    return low, min(max((x - here) / (there - here), 0.0), 1.0), fade


def learnt_map_weights(q, v, a, t, s, p):
    """Return the first value that counts, the step to its neighbour in the first coordinate, and four weights.

    The weights belong to the values (first), (first + 1), (first + step) and (first + step + 1); over one coordinate
    the last two are zero. The force is their sum, without the scale.
    """
    one = int(p[SCALARS + 1])
    i, fraction, fade = between(one, coordinate(one, q, v, a, t, s), p)
    if int(p[SCALARS]) < 2:
        return i, 0, fade * (1.0 - fraction), fade * fraction, 0.0, 0.0
    two = int(p[SCALARS + 2])
    j, share, left = between(two, coordinate(two, q, v, a, t, s), p)
    step = grid_length(two, p)
    low, high = fade * left * (1.0 - fraction), fade * left * fraction
    return i * step + j, step, low * (1.0 - share), low * share, high * (1.0 - share), high * share


def learnt_map(q, v, a, t, s, p):
    """Return the force of the map [N]; bounded by its largest value times the scale."""
    first, step, one, two, three, four = learnt_map_weights(q, v, a, t, s, p)
    at = list_start(NUMBER_OF_GRIDS + 1, p) + 1 + first
    force = one * p[at] + two * p[at + 1]
    if step > 0:
        force += three * p[at + step] + four * p[at + step + 1]
    return p[0] * force
