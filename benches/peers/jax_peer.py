"""The workloads in JAX in the fastest form found: an array per coordinate, scan over the steps, jit."""

import itertools
from functools import partial

import peer

try:
    import jax
    import jax.numpy as jnp
except ImportError as error:
    peer.absent("JAX", error)

# Larger batches fall out of the caches; cut into tiles of this many they may be faster.
TILE = 4096


def control(layers, x):
    """The network at the columns of states `x`."""
    y = jnp.stack(x, axis=1)
    for weight, bias in layers[:-1]:
        y = jnp.maximum(y @ weight.T + bias, 0.0)
    weight, bias = layers[-1]
    return list(jnp.tanh(y @ weight.T + bias).T)


def measures(layers, horizon, gamma, starts):
    """Reach-avoid measures of starts `[N, 12]`."""
    x = list(starts.T)
    fold = peer.judge(jnp, x, 1.0, jnp.full_like(x[0], 1e30), jnp.full_like(x[0], -1e30))

    def advance(carry, discount):
        x, fold = carry
        x = peer.step(x, control(layers, x))
        return (x, peer.judge(jnp, x, discount, *fold)), None

    discounts = gamma ** jnp.arange(1, horizon + 1, dtype=jnp.float32)
    (_, (_, best)), _ = jax.lax.scan(advance, (x, fold), discounts)
    return best


def in_tiles(measures, starts):
    return jax.lax.map(measures, starts.reshape(-1, TILE, 12)).reshape(-1)


def rollout(work, network, count):
    layers = [tuple(map(jnp.asarray, layer)) for layer in work.network(network)]
    whole = partial(measures, layers, work.settings["horizon"], work.settings["gamma"])
    forms = [whole, partial(in_tiles, whole)] if count > TILE and count % TILE == 0 else [whole]
    starts = jnp.asarray(work.starts[:count])
    forms = [jax.jit(form).lower(starts).compile() for form in forms]
    accept = partial(peer.check_measures, work, network, count)
    calls = [lambda form=form: form(starts).block_until_ready() for form in forms]
    return peer.fastest([(call, accept) for call in calls])


def costs(mppi, controls):
    """Costs of the controls `[H, 3, K]`."""
    x = [jnp.full(controls.shape[2], value, jnp.float32) for value in mppi["start"]]
    last = jnp.zeros(mppi["horizon"]).at[-1].set(1.0)

    def advance(carry, stage):
        (x, total), (u, last) = carry, stage
        total += peer.lane_cost(jnp, x, u, mppi["speed"], mppi["cost"], last)
        return (peer.step(x, u), total), None

    (_, total), _ = jax.lax.scan(advance, (x, jnp.zeros_like(x[0])), (controls, last))
    return total


def improved(mppi, controls):
    weights = jax.nn.softmax(-costs(mppi, controls) / mppi["temperature"])
    return controls @ weights


def keyed(drawn):
    """Calls of `drawn(key)`, each with another key."""
    # Making keys is no part of the work.
    keys = itertools.cycle(list(jax.random.split(jax.random.key(1), 1000)))
    drawn = jax.jit(drawn).lower(next(keys)).compile()
    return lambda: drawn(next(keys)).block_until_ready()


def plan(work, samples):
    mppi = work.settings["mppi"]
    shape = (mppi["horizon"], 3, samples)

    def drawn(key):
        noise = mppi["sigma"] * jax.random.normal(key, shape)
        return improved(mppi, jnp.clip(noise, -1.0, 1.0))

    ours = work.array("mppi_controls").reshape(-1, mppi["horizon"], 3).transpose(1, 2, 0)
    peer.check_plan(work, jax.jit(partial(costs, mppi))(ours), jax.jit(partial(improved, mppi))(ours))
    return keyed(drawn)


if __name__ == "__main__":
    peer.serve(f"JAX {jax.__version__}", rollout, plan)
