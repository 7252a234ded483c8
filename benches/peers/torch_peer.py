"""The workloads in PyTorch: layers and the linear step as matrix products of the whole batch."""

from functools import partial

import peer

try:
    import torch
except ImportError as error:
    peer.absent("PyTorch", error)


def control(layers, x):
    """The network at the states `x`, `[12, N]`."""
    for weight, bias in layers[:-1]:
        x = torch.addmm(bias, weight, x).relu_()
    weight, bias = layers[-1]
    return torch.addmm(bias, weight, x).tanh_()


def step(matrices, x, u):
    a, b, constant = matrices
    return torch.addmm(torch.addmm(constant, b, u), a, x)


def judge(x, discount, safe, best):
    return peer.judge(torch, x, discount, safe, best)


def stage(x, u, speed, cost, last):
    return peer.lane_cost(torch, x, u, speed, cost, last)


def matrices():
    a, b, constant = peer.step_matrices()
    return torch.tensor(a), torch.tensor(b), torch.tensor(constant[:, None])


def measures(layers, settings, judge, starts):
    """Reach-avoid measures of starts `[12, N]`."""
    parts, x = matrices(), starts
    fold = torch.full_like(x[0], 1e30), torch.full_like(x[0], -1e30)
    fold = judge(x, torch.tensor(1.0), *fold)
    for t in range(1, settings["horizon"] + 1):
        x = step(parts, x, control(layers, x))
        fold = judge(x, torch.tensor(settings["gamma"] ** t), *fold)
    return fold[1]


def ways(function, arguments):
    """The function as it is and, where that works, compiled for batches of any size."""
    compiled = torch.compile(function, dynamic=True)
    try:
        for count in (48, 64):
            compiled(*arguments(count))
    except Exception:  # The compiler needs tools that may not be there.
        return [function]
    return [function, compiled]


def rollout(work, network, count):
    layers = [(torch.tensor(w), torch.tensor(b[:, None])) for w, b in work.network(network)]
    starts = torch.tensor(work.starts[:count].T).contiguous()
    accept = partial(peer.check_measures, work, network, count)
    forms = ways(judge, lambda n: (torch.ones(12, n), torch.tensor(1.0), *torch.ones(2, n)))
    calls = [partial(measures, layers, work.settings, form, starts) for form in forms]
    return peer.fastest([(call, accept) for call in calls])


def costs(mppi, stage, controls):
    """Costs of the controls `[H, 3, K]`."""
    parts, total = matrices(), torch.zeros(controls.shape[2])
    x = torch.tensor(mppi["start"])[:, None].expand(12, controls.shape[2]).contiguous()
    for t, u in enumerate(controls):
        last = torch.tensor(float(t + 1 == mppi["horizon"]))
        total = total + stage(x, u, mppi["speed"], mppi["cost"], last)
        x = step(parts, x, u)
    return total


def improved(mppi, stage, controls):
    weights = torch.softmax(-costs(mppi, stage, controls) / mppi["temperature"], 0)
    return controls @ weights


def drawn(mppi, stage, samples):
    noise = torch.randn(mppi["horizon"], 3, samples).mul_(mppi["sigma"])
    return improved(mppi, stage, noise.clamp_(-1.0, 1.0))


def plan(work, samples):
    mppi = work.settings["mppi"]
    ours = work.array("mppi_controls").reshape(-1, mppi["horizon"], 3).transpose(1, 2, 0)
    ours = torch.tensor(ours).contiguous()

    def accept(stage, _):
        peer.check_plan(work, costs(mppi, stage, ours), improved(mppi, stage, ours))

    numbers = mppi["speed"], mppi["cost"], torch.tensor(0.0)
    forms = ways(stage, lambda n: (torch.ones(12, n), torch.ones(3, n), *numbers))
    calls = [(partial(drawn, mppi, form, samples), partial(accept, form)) for form in forms]
    return peer.fastest(calls)


def at_inference(prepare):
    """The same, preparation and call without records for derivatives."""

    def prepared(*asked):
        with torch.inference_mode():
            return torch.inference_mode()(prepare(*asked))

    return prepared


if __name__ == "__main__":
    torch.manual_seed(1)
    peer.serve(f"PyTorch {torch.__version__}", at_inference(rollout), at_inference(plan))
