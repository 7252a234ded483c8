"""What the peers share: the exported work, the race's formulas, checking, timing and answering."""

import json
import pathlib
import sys
import time

try:
    import numpy as np
except ImportError as error:
    print(json.dumps({"absent": str(error)}), flush=True)
    sys.exit()

# Gains of the opponent: position across, velocity across, velocity along the way to the gate.
POSITION, VELOCITY, ALONG = 9.1704, 16.8205, 3.1127
DT, PUSH = 0.1, 0.05
# Largest difference of a number over its size, or over 1: f32 leaves some millionths.
TOLERANCE = 1e-4
# The same of the controls of a plan, whose weights are exponentials of differences of large costs.
CONTROL_TOLERANCE = 1e-2


class Work:
    """The folder that `reachcast bench --export` wrote."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.settings = json.loads((self.folder / "settings.json").read_text())
        self.starts = self.array("starts")

    def array(self, name):
        return np.load(self.folder / f"{name}.npy")

    def network(self, name):
        """Weights `[out, in]` and biases `[out]` of each layer; relu inside, tanh at the end."""
        raw = (self.folder / f"{name}.safetensors").read_bytes()
        body = 8 + int.from_bytes(raw[:8], "little")
        header = json.loads(raw[8:body])
        words = header.pop("__metadata__")
        assert (words["activation"], words["output"]) == ("relu", "tanh"), words

        def tensor(key):
            first, end = header[key]["data_offsets"]
            numbers = np.frombuffer(raw[body + first : body + end], "<f4")
            return numbers.reshape(header[key]["shape"])

        layers = range(len(header) // 2)
        return [(tensor(f"layers.{i}.weight"), tensor(f"layers.{i}.bias")) for i in layers]


def step(x, u):
    """One Euler step of both drones; `x` and `u` are lists of arrays, `u` within [-1, 1]."""
    ex, evx, ey, evy, ez, evz, ox, ovx, oy, ovy, oz, ovz = x
    return [
        ex + DT * evx, evx + PUSH * u[0],
        ey + DT * evy, evy + PUSH * u[1],
        ez + DT * evz, evz + PUSH * u[2],
        ox + DT * ovx, ovx - DT * (POSITION * ox + VELOCITY * ovx),
        oy + DT * ovy, ovy + DT * ALONG * (0.3 - ovy),
        oz + DT * ovz, ovz - DT * (POSITION * oz + VELOCITY * ovz),
    ]  # fmt: skip


def step_matrices():
    """The same step, which is linear: `A x + B u + c`."""
    zero, state, control = np.zeros(1), np.eye(12), np.eye(3)
    constant = np.stack(step([zero[0]] * 12, [zero[0]] * 3))
    a = np.stack([np.stack(step(column, [0.0] * 3)) - constant for column in state], axis=1)
    b = np.stack([np.stack(step([0.0] * 12, column)) - constant for column in control], axis=1)
    return [matrix.astype(np.float32) for matrix in (a, b, constant)]


def margins(xp, x):
    """Target and constraint margin; `xp` is jax.numpy or torch."""
    ex, _, ey, evy, ez, _, ox, _, oy, ovy, oz, _ = x
    aside = xp.maximum(abs(ex), abs(ez))
    target = xp.minimum(xp.minimum(ey - oy, evy - ovy), 0.3 - aside)
    cone = xp.sqrt((ex - ox) ** 2 + (ey - oy) ** 2) - 0.2 * (1.0 + xp.clip(oz - ez, 0.0, None))
    return 10.0 * target, 10.0 * xp.minimum(cone, 0.05 - ey - aside)


def judge(xp, x, discount, safe, best):
    """Adds a state to the measure: smallest discounted constraint margin, best so far."""
    target, constraint = margins(xp, x)
    safe = xp.minimum(safe, discount * constraint)
    return safe, xp.maximum(best, xp.minimum(safe, discount * target))


def lane_cost(xp, x, u, speed, cost, last):
    """The stage cost of lane plans; `last` is 1 at the last stage."""
    ex, evx, _, evy, ez, evz, *_ = x
    widest = xp.maximum(abs(ex), abs(ez))
    away = xp.where(ex * evx > 0.0, evx**2, 0.0) + xp.where(ez * evz > 0.0, evz**2, 0.0)
    wide = xp.where(widest > 0.15, (widest - 0.05) ** 2, 0.0)
    return (
        (cost["lane"] + last * cost["last"]) * (ex**2 + ez**2)
        + cost["speed"] * (evy - speed) ** 2
        + cost["away"] * away
        + cost["wide"] * wide
        + cost["control"] * (u[0] ** 2 + u[1] ** 2 + u[2] ** 2)
    )


def check(name, ours, theirs, tolerance=TOLERANCE, exempt=0.0):
    """Refuses results that are not ours, but for the share `exempt` of them."""
    ours, theirs = np.ravel(ours), np.ravel(theirs)[: np.size(ours)]
    gap = np.nan_to_num(np.abs(ours - theirs) / np.maximum(1.0, np.abs(ours)), nan=np.inf)
    worst = int(np.argmax(gap))
    if np.mean(gap > tolerance) > exempt:
        raise ValueError(f"{name} {worst} is {theirs[worst]}, expected {ours[worst]}")


def check_measures(work, network, count, theirs):
    """A steep policy makes more of a rounding: one measure in a thousand may be farther off."""
    check("measure", work.array(f"{network}_measures")[:count], theirs, exempt=0.001)


def check_plan(work, costs, plan):
    """The cost jumps where a sample crosses the centre line: a rounding may move it to a neighbour."""
    check("cost", work.array("mppi_costs"), costs, exempt=0.01)
    check("control", work.array("mppi_plan"), plan, CONTROL_TOLERANCE)


def seconds_of(call, warm_up_seconds, budget_seconds):
    """Times calls as `reachcast bench` does in src/bench/measure.rs; also the last result."""
    warm, counted = 0.0, []
    while not counted or sum(counted) < budget_seconds:
        begun = time.perf_counter()
        result = call()
        seconds = time.perf_counter() - begun
        if warm < warm_up_seconds and seconds < budget_seconds:
            warm += seconds
        else:
            counted.append(seconds)
    return counted, result


def fastest(ways):
    """Of several ways to do the same, each a call and a check of its result, the fastest sound one."""
    best, chosen, refusal = float("inf"), None, None
    for call, accept in ways:
        try:
            seconds, result = seconds_of(call, 0.05, 0.2)
            accept(result)
        except Exception as error:  # A compiler may need tools that are not there.
            refusal = refusal or error
            continue
        if min(seconds) < best:
            best, chosen = min(seconds), call
    if chosen is None:
        raise refusal
    return chosen


def serve(title, rollout, plan):
    """Answers requests on standard input.

    `rollout(work, network, count)` and `plan(work, samples)` check, then give the call.
    """
    work, calls = Work(sys.argv[1]), {}
    print(json.dumps({"title": title}), flush=True)
    for line in sys.stdin:
        asked = json.loads(line)
        name = asked.pop("workload")
        kind, network, size = name.split("/")
        units = int(size)
        try:
            if name not in calls:
                calls[name] = plan(work, units) if kind == "mppi" else rollout(work, network, units)
            answer = {"rate": units / float(np.median(seconds_of(calls[name], **asked)[0]))}
        except Exception as error:  # Whatever it is, it belongs into the table.
            answer = {"refused": f"{type(error).__name__}: {error}".splitlines()[0]}
        print(json.dumps(answer), flush=True)


def absent(title, error):
    """Says that the library is not there."""
    print(json.dumps({"title": title, "absent": str(error)}), flush=True)
    sys.exit()
