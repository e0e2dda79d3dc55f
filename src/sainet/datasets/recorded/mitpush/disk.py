"""The disk of the MIT Push dataset, what pushes it, and how fast."""

DISK = "ellip1"
NO_DISKS = (
    *("ellip2", "ellip3", "rect1", "rect2", "rect3", "tri1", "tri2", "tri3"),
    *("hex", "butter"),
)
MASS = 0.8937  # kg
RADIUS = 0.0525  # m
PUSHER_RADIUS = 0.00475  # m
SPEED_RANGE = (1.0, 1000.0)  # mm/s: 12,000 to 12 steps of a push
