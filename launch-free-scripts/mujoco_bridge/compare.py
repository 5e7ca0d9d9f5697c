"""sweepd's colliding set against MuJoCo's, step by step.

In: both sets of one step. Out: a tally. A difference is exempt only where MuJoCo's or the third judge's gap is within
1e-6 m of 0; more than 1 % of such is a failure too. Without a budget a pair that is left open is a difference; under a
budget it is not, and what is checked is the promise: no collision missing from colliding and possible together, none
invented.
"""

from .judge import BAND_M

EXEMPT_SHARE_MAX = 0.01
"""Greatest share of exempt pair-steps."""
JUDGED_MAX = 500
"""Differences beyond exemption after which the third judge is not asked again: the comparison has failed, and he is slow."""
SHOWN_MAX = 20
"""Differences that are kept in words."""


class Compare:
    """Counts over all steps."""

    def __init__(self, scene, judge, at_least=0, budgeted=False):
        self.scene = scene
        self.judge = judge
        self.at_least = at_least
        self.budgeted = budgeted
        self.steps = 0
        self.steps_equal = 0
        self.colliding = 0
        self.in_band = 0
        self.exempt = 0
        self.exempt_with_sweepd = 0
        self.different = 0
        self.undecided = 0
        self.shown = []

    def step(self, number, sweepd, possible, mujoco):
        """Compares one step.

        * `sweepd` - set of pairs that it says collide. `possible` - set of pairs that it left open.
        * `mujoco` - dict of pairs that collide there, with `dist` in metres.
        """
        self.steps += 1
        self.colliding += len(sweepd | mujoco.keys())
        self.in_band += sum(abs(dist) <= BAND_M for dist in mujoco.values())
        self.undecided += len(possible)
        bad = 0
        for pair in sorted((sweepd ^ mujoco.keys()) - possible):
            gap = self.gap(pair)
            by_mujoco = mujoco.get(pair)
            near = abs(gap) <= BAND_M or (by_mujoco is not None and abs(by_mujoco) <= BAND_M)
            self.exempt += near
            self.exempt_with_sweepd += near and (gap <= 0) == (pair in sweepd)
            bad += not near
            self.show(number, pair, pair in sweepd, by_mujoco, gap, near)
        for pair in () if self.budgeted else sorted(possible):
            bad += not abs(self.gap(pair)) <= BAND_M
        self.different += bad
        self.steps_equal += bad == 0

    def gap(self, pair):
        """The third judge's gap, metres; NaN, which exempts nothing, once he is not asked any more."""
        return self.judge.gap(*pair) if self.different < JUDGED_MAX else float("nan")

    def show(self, number, pair, by_sweepd, by_mujoco, gap, near):
        """Keeps the first differences in words."""
        if len(self.shown) < SHOWN_MAX:
            first, second = (f"{self.scene.names[k]} ({self.scene.shapes[k]['type']})" for k in pair)
            self.shown.append(
                f"step {number}: {first} and {second}:"
                f" sweepd {'collides' if by_sweepd else 'apart'},"
                f" MuJoCo {'apart' if by_mujoco is None else f'collides, dist {by_mujoco:.3g} m'},"
                f" third judge {gap:.3g} m: {'exempt' if near else 'DIFFERENT'}"
            )

    def share(self):
        """Exempt pair-steps by colliding pair-steps."""
        return self.exempt / max(1, self.colliding)

    def holds(self):
        """Whether there was a step, the sets are equal in every one, and enough collided to mean something."""
        enough = self.steps > 0 and self.colliding >= self.at_least
        return enough and self.different == 0 and self.share() <= EXEMPT_SHARE_MAX

    def summary(self):
        """Counts for `--json`."""
        return {
            "steps": self.steps,
            "steps_equal": self.steps_equal,
            "colliding_pair_steps": self.colliding,
            "different_pair_steps": self.different,
            "exempt_pair_steps": self.exempt,
            "exempt_where_third_judge_agrees_with_sweepd": self.exempt_with_sweepd,
            "exempt_share": self.share(),
            "mujoco_within_band": self.in_band,
            "possible_pair_steps": self.undecided,
            "equal": self.holds(),
            "differences": self.shown,
        }
