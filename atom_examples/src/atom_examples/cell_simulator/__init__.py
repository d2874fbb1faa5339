"""The simulated collaborative cell: what its sensors see of a board, with known truth.

``world.World(seed)`` is the cell: ``scene`` (MuJoCo as a kinematic renderer, no dynamics), and the
sensors ``camera``, ``depth`` and ``lidar``. ``planner`` says where the board stands,
``trajectory`` how it gets from one stop to the next. None of these knows ROS; ``messages``,
``recorder`` (bags, no master) and ``node`` (live) do.
"""
