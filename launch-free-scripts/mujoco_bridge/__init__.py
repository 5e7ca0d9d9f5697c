"""Rooms of `mujoco_bridge.py`: from an MJCF model to a sweepd scene, its poses, and a second opinion on them.

model    MJCF in, a compiled MuJoCo model out; kinds that sweepd lacks are refused or turned into hulls
shapes   one geom in, the same shape in sweepd's words and as a support function out
filters  MuJoCo's rules on who may collide in, sweepd's groups, rigid groups and pair rules out
scene    the scene file
judge    MuJoCo's contacts at margin 0, and the gap of a pair by a third method
compare  sweepd's colliding set against MuJoCo's, step by step
daemon   starts sweepd, and ends it
"""
