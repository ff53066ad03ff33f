"""The pictures of docs/VISIBILITY.md, one for each stage: the same few rooms from above, and
what each stage leaves of what the one before it left. Everything is computed, in the plane:
portals by cutting angles, occlusion and fragments by rays. Standard library only.

usage: python3 scripts/funnel-pictures.py [--check] [FOLDER]     (docs)
"""

import math
import sys
from pathlib import Path

# Rooms as low and high corner; walls have no thickness.
ROOMS = [(0, 0, 6, 8), (6, 0, 12, 8), (12, 0, 19, 8), (0, 8, 8, 13), (8, 8, 19, 13)]
# Doors as their ends and the two rooms beside them.
DOORS = [((6, 3.0), (6, 5.2), 0, 1), ((12, 2.4), (12, 5.4), 1, 2), ((2, 8), (3.2, 8), 0, 3),
         ((14, 8), (15.2, 8), 2, 4)]
# Items as low corner and size.
ITEMS = [(1.6, 6.2, 1, 1), (0.4, 0.6, 1.2, 0.8), (4.4, 0.8, 0.9, 0.9), (4.6, 3.0, 0.7, 0.7),
         (8.6, 1.0, 1, 1), (8.0, 3.7, 1.3, 1.3), (10.4, 3.6, 0.9, 1.1), (7.2, 6.4, 1, 1),
         (10.6, 6.0, 0.9, 0.9), (14.0, 3.9, 1, 1), (16.2, 2.9, 1, 0.9), (16.6, 5.6, 1.2, 1),
         (13.4, 0.7, 1, 1), (17.4, 0.8, 0.8, 0.8), (1.2, 9.6, 1, 1), (4.8, 10.8, 1.2, 1),
         (9.4, 9.4, 1, 1), (12.4, 11.2, 1, 1), (16.6, 10, 1.1, 1.1)]
# Another map of the same file.
OTHER_ROOMS = [(0, -7, 8, -2), (8, -7, 19, -2)]
OTHER_ITEMS = [(1, -4, 1, 1), (4.6, -6, 1.2, 1), (9.6, -4.2, 1, 1), (13, -6, 1, 1), (16, -4, 1, 1)]
EYE = (0.9, 4.1)
HALF = math.radians(32)
RAYS = 6000
SAMPLES = 45

GONE, BEFORE, LEFT, SEEN, INK = "#f0c88c", "#e8e8e8", "#56b4e9", "#00825a", "#202020"


def angle(point):
    return math.atan2(point[1] - EYE[1], point[0] - EYE[0])


def corners(item):
    x, y, w, h = item
    return [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]


def edges(item):
    # Counter-clockwise, so that a front is to the right of its direction.
    c = corners(item)
    return list(zip(c, c[1:] + c[:1]))


def seen_rooms(home, low, high, seen):
    """Rooms that a part of the view reaches through doors, by angles."""
    seen.add(home)
    for a, b, one, other in DOORS:
        if home in (one, other):
            ends = sorted((angle(a), angle(b)))
            beyond = other if home == one else one
            cut = max(low, ends[0]), min(high, ends[1])
            if beyond not in seen and cut[0] < cut[1]:
                seen_rooms(beyond, *cut, seen)
    return seen


def is_in(item, room):
    x0, y0, x1, y1 = ROOMS[room]
    return x0 <= item[0] and item[0] + item[2] <= x1 and y0 <= item[1] and item[1] + item[3] <= y1


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def hit(direction, a, b):
    """How far along a ray from the eye a segment is, if it is met."""
    along, to = (b[0] - a[0], b[1] - a[1]), (a[0] - EYE[0], a[1] - EYE[1])
    det = cross(direction, along)
    if det == 0:
        return None
    t, s = cross(to, along) / det, cross(to, direction) / det
    return t if t > 0 and 0 <= s <= 1 else None


def walls():
    """The sides of all rooms without their doors."""
    for x0, y0, x1, y1 in ROOMS:
        for a, b in edges((x0, y0, x1 - x0, y1 - y0)):
            a, b = sorted((a, b))
            axis = 0 if a[1] == b[1] else 1
            doors = sorted((p, q) for p, q, *_ in DOORS
                           if p[1 - axis] == a[1 - axis] and a[axis] <= p[axis] and q[axis] <= b[axis])
            for p, q in doors:
                yield a, p
                a = q
            yield a, b


WALLS = list(dict.fromkeys(walls()))


def meets(direction, items):
    """What a ray meets, from near to far: items with the distance of their fronts."""
    found = []
    for item in items:
        ts = [t for a, b in edges(ITEMS[item]) if (t := hit(direction, a, b)) is not None]
        if ts:
            found.append((min(ts), item))
    return sorted(found)


def wall_at(direction):
    return min(t for a, b in WALLS if (t := hit(direction, a, b)) is not None)


def rays(count):
    """Through the middles of equal parts of an image plane."""
    for i in range(count):
        y = math.tan(HALF) * (2 * (i + 0.5) / count - 1)
        yield (1.0, y)


def stages():
    """By stage: what is left of the items."""
    every = list(range(len(ITEMS)))
    rooms = seen_rooms(0, -HALF, HALF, set())
    region = [i for i in every if any(is_in(ITEMS[i], room) for room in rooms)]

    def in_view(i):
        slope = math.tan(HALF)
        inside = [[p[0] > EYE[0], p[1] - EYE[1] <= slope * (p[0] - EYE[0]),
                   EYE[1] - p[1] <= slope * (p[0] - EYE[0])] for p in corners(ITEMS[i])]
        return all(any(side) for side in zip(*inside))

    objects = [i for i in region if in_view(i)]
    seen = set()
    for direction in rays(RAYS):
        met = meets(direction, objects)
        if met and met[0][0] < wall_at(direction):
            seen.add(met[0][1])
    return every, rooms, region, objects, [i for i in objects if i in seen]


class Picture:
    SCALE = 26

    def __init__(self, title, low=0.0):
        self.low, self.high = low, 13.0
        self.width = round(19 * self.SCALE + 24)
        self.height = round((self.high - low) * self.SCALE + 44)
        self.parts = [f'<rect width="{self.width}" height="{self.height}" fill="#fff"/>',
                      f'<text x="12" y="20" font-size="15">{title}</text>']

    def at(self, point):
        return (round(12 + point[0] * self.SCALE, 1),
                round(32 + (self.high - point[1]) * self.SCALE, 1))

    def line(self, a, b, colour=INK, width=2.0, dash=""):
        (x0, y0), (x1, y1) = self.at(a), self.at(b)
        dash = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(f'<line x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}" stroke="{colour}" '
                          f'stroke-width="{width}"{dash}/>')

    def box(self, item, fill, stroke="none"):
        x, y = self.at((item[0], item[1] + item[3]))
        w, h = (round(side * self.SCALE, 1) for side in item[2:])
        self.parts.append(f'<rect x="{x}" y="{y}" width="{w}" height="{h}" fill="{fill}" '
                          f'stroke="{stroke}"/>')

    def dot(self, point, fill, radius=4, stroke="none"):
        x, y = self.at(point)
        self.parts.append(f'<circle cx="{x}" cy="{y}" r="{radius}" fill="{fill}" '
                          f'stroke="{stroke}"/>')

    def plan(self):
        for a, b in WALLS:
            self.line(a, b)
        for side in (-HALF, HALF):
            reach = 19 - EYE[0]
            y = EYE[1] + reach * math.tan(side)
            edge = 13 if side > 0 else 0
            reach = min(reach, (edge - EYE[1]) / math.tan(side))
            y = EYE[1] + reach * math.tan(side)
            self.line(EYE, (EYE[0] + reach, y), "#808080", 1.0, "5 4")
        self.dot(EYE, INK, 5)

    def write(self):
        return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height}" '
                f'width="{self.width}" font-family="sans-serif">\n' + "\n".join(self.parts)
                + "\n</svg>\n")


def of_items(title, given, left, shaded=()):
    picture = Picture(f"{title}: {len(given)} items in, {len(left)} left")
    for room in shaded:
        x0, y0, x1, y1 = ROOMS[room]
        picture.box((x0, y0, x1 - x0, y1 - y0), "#eaf5ee")
    for i, item in enumerate(ITEMS):
        fill = LEFT if i in left else GONE if i in given else "none"
        picture.box(item, fill, "none" if i in given else "#c8c8c8")
    picture.plan()
    return picture


def pictures():
    every, rooms, region, objects, visible = stages()
    total = len(ITEMS) + len(OTHER_ITEMS)
    level = Picture(f"level: {total} items in the file, {len(ITEMS)} in the selected map", -7.4)
    for item in OTHER_ITEMS:
        level.box(item, GONE)
    for x0, y0, x1, y1 in OTHER_ROOMS:
        level.box((x0, y0, x1 - x0, y1 - y0), "none", "#808080")
    for item in ITEMS:
        level.box(item, LEFT)
    for a, b in WALLS:
        level.line(a, b)
    yield "level", level
    yield "region", of_items("region, through the doors", every, region, rooms)
    yield "object", of_items("object, by the frustum", region, objects)
    yield "occlusion", of_items("occlusion, behind walls and others", objects, visible)

    # An edge is what a triangle is in space: its front is on its right.
    sides = [(i, a, b) for i in visible for a, b in edges(ITEMS[i])]
    turned = {(i, a, b): cross((b[0] - a[0], b[1] - a[1]), (EYE[0] - a[0], EYE[1] - a[1]))
              for i, a, b in sides}
    faces = [side for side in sides if turned[side] < 0]
    triangle = Picture(f"triangle, turned away: {len(sides)} sides in, {len(faces)} left")
    for i in visible:
        triangle.box(ITEMS[i], "#f4f4f4")
    for side in sides:
        colour = SEEN if side in faces else GONE
        triangle.line(side[1], side[2], colour, 3.5)
    triangle.plan()
    yield "triangle", triangle

    dots, fragments, shaded = [], 0, 0
    for direction in rays(SAMPLES):
        wall = wall_at(direction)
        met = meets(direction, visible)
        for n, (t, _) in enumerate(met):
            point = (EYE[0] + t * direction[0], EYE[1] + t * direction[1])
            is_first = n == 0 and t < wall
            fragments, shaded = fragments + 1, shaded + is_first
            dots.append((point, is_first))
    title = f"fragment, in front at a sample: {fragments} fragments, {shaded} shaded"
    fragment = Picture(title)
    for direction in rays(SAMPLES):
        t = wall_at(direction)
        fragment.line(EYE, (EYE[0] + t * direction[0], EYE[1] + t * direction[1]), "#d8d8d8", 1.0)
    for i in visible:
        fragment.box(ITEMS[i], "none", "#808080")
    fragment.plan()
    for point, is_first in dots:
        fragment.dot(point, SEEN if is_first else "#fff", 4, SEEN if is_first else "#d55e00")
    yield "fragment", fragment


def main():
    arguments = sys.argv[1:]
    is_check = "--check" in arguments
    folders = [argument for argument in arguments if argument != "--check"]
    folder = Path(folders[0]) if folders else Path(__file__).parent.parent / "docs"
    for stage, picture in pictures():
        file = folder / f"funnel-{stage}.svg"
        if not is_check:
            file.write_text(picture.write())
        elif not file.exists() or file.read_text() != picture.write():
            sys.exit(f"{file}: not what scripts/funnel-pictures.py draws; expected to be drawn anew")


main()
