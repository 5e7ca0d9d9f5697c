"""The Python client against the stand-in daemon of tests/transport_python.rs; any failed assert ends it with 1.

The stand-in answers each frame with one colliding pair (body, body + 1) a body, whose gap_best_m is the body's x.
"""

import sys

import numpy as np
import sweepd
from sweepd import layout

root, prefix, part = sys.argv[1:4]
where = dict(root=root, prefix=prefix, quat_order="xyzw")


def raises(kind, words, act):
    try:
        act()
    except kind as e:
        assert words in str(e), (words, str(e))
        return e
    raise AssertionError(f"no {kind.__name__}")


if part == "alone":
    raises(sweepd.TimedOut, "sweepd run", lambda: sweepd.Client("cell", timeout_s=0.2, **where))
    raises(sweepd.Refused, "instance name", lambda: sweepd.Client("Cell", **where))
    raises(sweepd.SweepdError, "quat_order", lambda: sweepd.Client("cell", **{**where, "quat_order": "?"}))
    raises(sweepd.SweepdError, "1 to 31 bytes", lambda: sweepd.Client("cell", 32 * "s", **where))
    raises(sweepd.TimedOut, "sweepd run", lambda: sweepd.Client("cell", 31 * "s", timeout_s=0.2, **where))
    sys.exit()

client = sweepd.Client("cell", "sim", timeout_s=5, **where)
assert client.names == {"box": 1}, client.names
assert client.name_of(1) == "box" and client.name_of(2) is None

if part == "long":
    # each tick is told of twice, alone, before it is there
    reader = sweepd.Client("cell", None, timeout_s=5, **where)
    told, last = 0, 0
    for x in range(1, 21):
        result = client.step({"box": ((x, 0, 0), (0, 0, 0, 1))}, timeout_s=5)
        assert result.pairs["gap_best_m"].tolist() == [float(x)], (x, result.pairs)
        while last < result.tick.header.tick:
            seen = reader.wait(5)
            if seen.state == "unknown":
                told += 1
                assert seen.tick.sources_len == 0 and seen.pairs is None
                why = reader._why_no_result(x, None, 5)
                assert "still under way" in why and "no such source" not in why, why
            else:
                last = seen.tick.header.tick
    # of the first tick the daemon may have told before it knew of this reader
    assert told in (38, 40), told
    sys.exit()

if part == "restart":
    client.step({"box": ((1, 0, 0), (0, 0, 0, 1))}, timeout_s=5)
    print("STEPPED", flush=True)
    sys.stdin.readline()
    error = raises(
        sweepd.Restarted, "restarted", lambda: client.step({"box": ((2, 0, 0), (0, 0, 0, 1))}, timeout_s=5)
    )
    assert (error.old_boot, error.new_boot) == (7, 8)
    result = client.step({"box": ((3, 0, 0), (0, 0, 0, 1))}, timeout_s=5)
    assert result.pairs["gap_best_m"][0] == 3
    sys.exit()

# by name: exactly this frame's result
for x in range(1, 101):
    result = client.step({"box": ((x, 0, 0), (0, 0, 0, 1))}, timeout_s=5)
    assert result.pairs["gap_best_m"].tolist() == [float(x)], (x, result.pairs)
    assert result.colliding.tolist() == [[1, 2]]
    assert len(result.contacts) == 1 and result.contacts["body_a"][0] == 1
    assert result.tick.header.boot_id == 7

# by arrays, and in place
n = 1000
rows = client.rows((np.arange(1, n + 1), np.zeros((n, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))))
for x in range(20):
    rows["position"][:, 0] = x + np.arange(n)
    result = client.step(rows, timeout_s=5)
    assert (result.pairs["gap_best_m"] == x + np.arange(n)).all()
    assert result.pairs.flags.writeable is False, "others read it too"

# results lie in shared memory, of many the later ones are copies; held ones do not change
held = []
for x in range(20):
    held.append(client.step({"box": ((x, 0, 0), (0, 0, 0, 1))}, timeout_s=5))
assert [result.pairs["gap_best_m"].tolist() for result in held] == [[float(x)] for x in range(20)]
assert not any(result.pairs.flags.writeable for result in held)
held.clear()
client.step({"box": ((4, 0, 0), (0, 0, 0, 1))}, timeout_s=5)

# quaternions: the order is said, and turned
wxyz = sweepd.Client("cell", None, timeout_s=5, **{**where, "quat_order": "wxyz"})
turned = wxyz.rows({"box": ((0, 0, 0), (1, 2, 3, 4))})
assert turned["orientation"].tolist() == [[2, 3, 4, 1]]
raises(sweepd.SweepdError, "as a reader", lambda: wxyz.send({"box": ((0, 0, 0), (1, 0, 0, 0))}))
raises(sweepd.SweepdError, "it has box", lambda: client.send({"ball": ((0, 0, 0), (0, 0, 0, 1))}))

# a reader's view, pauses, epochs, requests
assert wxyz.latest().tick.header.tick >= 100
assert wxyz.wait(5).state in ("clear", "near", "possible", "unknown", "colliding")
client.pause()
client.reset_epoch()
assert client.step({"box": ((5, 0, 0), (0, 0, 0, 1))}, timeout_s=5).tick.sources[0].epoch == 1
for _ in range(10):
    answer = client.request({"put": 1}, [b"\1\2\3"], timeout_s=5)
    assert answer["scene_rev"] == len('{"put": 1}') + 3, answer
wxyz.close()
client.close()
print("layouts", len(layout.LAYOUTS))
