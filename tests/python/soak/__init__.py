"""A soak of the whole system from outside: the real daemon, real clients, and a checker that knows the truth.

Bodies are spheres, axis-aligned boxes and half-spaces on closed-form paths, so that every gap, touch and touch on the
way is a formula (``shapes``, ``paths``, ``ways``). A driver mixes by a seed what happens to a daemon in use: frames in
every manner, scene edits, resets, clients and daemons that are killed (``driver``, ``deeds``, ``child``). Every tick
that a reader receives is held against msgs/README.md (``checker`` and the ``check_`` modules): nothing of the daemon's
own code, and nothing but what the contract says.

    SWEEPD=target/release/sweepd python -m soak --seconds 60 --seed 7 --mode on_all      # in tests/python

Not here: meshes and other shapes, attached and deforming bodies, ROS 2.
"""
