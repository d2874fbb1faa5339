"""Simulated robots that are data: a description, a configuration, and two files about them.

``sensors.yaml`` says how sensors measure and err, ``scenario.yaml`` where boards are and how joints
move. ``world.RobotWorld(robot, seed)`` is a robot in a room with its boards; ``stops`` draws where
joints and boards stand still, ``motion`` how they get from one stop to the next, ``recorder``
writes a bag and its truth. Pictures, rays and messages are those of ``cell_simulator``.
"""
