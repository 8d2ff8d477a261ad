"""Class docstrings of the environments, with Gymnasium's headings."""

from __future__ import annotations

from ncrs_envs.physics import TOUCH_DECAY
from ncrs_envs.tasks import CARRY_BALL, LIGHT_CHASE, OBSTACLE, OBSTACLE_TOUCH

_TEMPLATE = """{summary}

    ## Description
    {description}

    The robot is a grid of square cells with a side of 2 units: tissue, sensors and wheels, which
    form one rigid body. The default is a small four-wheeled body on a 5 x 5 grid; pass another
    one with `body`. The playfield runs from -P to P on both axes, with P = max(50, 5 n + 35) for an
    n x n grid: 60 units for 5 x 5. One step is 1/50 s.

    ## Action Space
    `Box(-1, 1, (n, n), float32)`: the gas of each cell, read in wheel cells and ignored elsewhere.
    A wheel at gas 1 pushes forward (the body's +y) with a force of 1000 and brakes with 20 per unit
    of speed forward, 100 per unit sideways. Values beyond [-1, 1] are clipped; NaN and infinite
    values are refused.

    ## Observation Space
    `Box(0, 1, (n, n), float32)`: in sensor cells `exp(-d / P)`, with d the distance from the cell's
    centre to {sensed}; {felt}0 elsewhere.

    ## Info
    `reset` and `step` return a dict with `body`, `sensor_mask`, `wheel_mask`, `pose` (x, y, heading
    in radians), {distances} and `success` (so far in this episode){crossed}.

    ## Rewards
    {rewards}
    With `distance_score="inverse_square"` the score of a distance d is `(d / P + 1)^-2` instead of
    `exp(-d / P)`, in rewards and sensors alike.

    ## Starting State
    {start}
    `reset(options={{"region": k}})` sets the region, `reset(options={{"scenario": scenario}})`
    all placements, and `reset(options={{"body": grid}})` sets the body for this and later episodes.
    `reset(options={{"damage": damage}})` takes cells away at a step of this episode.

    ## Episode End
    Termination: never, unless `terminate_on_success` is set; then as soon as {success}.
    Truncation: after 100 steps (2 s).

    ## Arguments
    `gymnasium.make("{env_id}", body=None, grid_size=None, render_mode=None,
    distance_score="exponential", success_radius=None, terminate_on_success=False,
    render_size=512, construction="rigid", hull_density=1.0)`
    - `body`: cell codes (0 empty, 1 tissue, 2 {sensor_2}, {code_3}4 wheel{code_5}), as an array,
      nested lists or rows of characters. It stays until `reset` replaces it.
    - `grid_size`: n, at least 3; by default that of `body`, or 5 without one.
    - `render_mode`: None, "rgb_array" or "human".
    - `distance_score`: "exponential" or "inverse_square".
    - `success_radius`: units, {radius:g} by default.
    - `terminate_on_success`: True to end an episode when it succeeds.
    - `render_size`: side of a frame in pixels.
    - `construction`: "rigid", or "jointed" as in the published code: a hull, and a body for each
      wheel on a locked joint. Robots whose hull is a cell or two wobble in it, and run faster.
    - `hull_density`: density of all cells but the wheels, 0.01 to 100; a wheel has 0.1.

    ## Version History
    - v0: first version.
    """

LIGHT_CHASE_DOC = _TEMPLATE.format(
    summary="Drive to a light in the open.",
    description="A light shines in one of four corners; the robot starts in the middle.",
    sensed="the light's centre",
    felt="",
    distances="`distance` (robot to light)",
    crossed="",
    rewards="`exp(-d / P)` each step, with d the distance from the robot's centre to the light.",
    start=(
        "The robot stands at (0, 0), heading +y. The light, a solid disc of radius 1, stands at\n"
        "    (-+0.6 P, -+0.6 P) plus uniform noise of +-0.05 P on each axis."
    ),
    success="the robot's centre has come within 20 units of the light",
    env_id=LIGHT_CHASE.env_id,
    sensor_2="light sensor",
    code_3="",
    code_5="",
    radius=LIGHT_CHASE.success_radius,
)

_OBSTACLE = {
    "distances": "`distance` (robot to light)",
    "crossed": ", and `crossed` (the centre has been above y = 0)",
    "sensed": "the light's centre (walls do not hide it)",
    "rewards": "`exp(-d / P)` each step, with d the distance from the robot's centre to the light.",
    "start": (
        "The robot stands at y = -0.85 P with x uniform in +-0.6 P, heading +y, clear of the\n"
        "    walls. The light stands at x in (-0.6 P, -0.3 P, 0.3 P, 0.6 P) and y = 0.6 P, plus\n"
        "    uniform noise of +-0.05 P on each axis. The passage's centre is uniform in +-0.8 P."
    ),
    "success": "the robot's centre has come within 20 units of the light",
    "sensor_2": "light sensor",
    "code_3": "",
    "radius": OBSTACLE.success_radius,
}

OBSTACLE_DOC = _TEMPLATE.format(
    summary="Drive to a light through a passage between two ragged walls.",
    description=(
        "Two walls narrow to a passage 1.4 n units wide, which a full-width robot cannot pass;\n"
        "    the light shines behind it."
    ),
    felt="",
    env_id=OBSTACLE.env_id,
    code_5="",
    **_OBSTACLE,
)

OBSTACLE_TOUCH_DOC = _TEMPLATE.format(
    summary="Drive to a light through a passage between two ragged walls, which the robot feels.",
    description=(
        "The courses are those of `NCRS-Obstacle-v0`, and bodies have touch sensors, too. This is\n"
        "    an extension: the paper has no such task."
    ),
    felt=(
        "in touch sensors 1 while the\n"
        f"    cell touches a wall, then {TOUCH_DECAY:g} times the value of the step before; "
    ),
    env_id=OBSTACLE_TOUCH.env_id,
    code_5=", 5 touch sensor",
    **_OBSTACLE,
)

CARRY_BALL_DOC = _TEMPLATE.format(
    summary="Push a ball to a target area.",
    description="A light ball lies ahead of the robot, and a square target area beyond it.",
    sensed="the ball (code 2) or the target (code 3)",
    felt="",
    distances="`distance_to_ball`, `ball_to_target`",
    crossed="",
    rewards=(
        "`0.5 exp(-a / P) + 0.5 exp(-b / P)` each step, with a the distance from the robot's\n"
        "    centre to the ball and b from the ball to the target."
    ),
    start=(
        "The robot stands at y = -0.85 P with x uniform in +-0.6 P, heading +y. The ball, of\n"
        "    radius 1, lies at x in (-0.6 P, -0.3 P, 0.3 P, 0.6 P) and y = 0, plus uniform noise\n"
        "    of +-0.05 P on each axis. The target is at one of those four x at random, y = 0.6 P."
    ),
    success="the ball has come within 10 units of the target",
    env_id=CARRY_BALL.env_id,
    sensor_2="ball sensor",
    code_3="3 target sensor, ",
    code_5="",
    radius=CARRY_BALL.success_radius,
)
