"""The workloads in JAX as they are usually written: one trajectory, scan over its steps, vmap, jit."""

from functools import partial

import peer

try:
    import jax
    import jax.numpy as jnp
except ImportError as error:
    peer.absent("JAX vmap", error)

from jax_peer import keyed


def control(layers, x):
    """The network at the state `x`, `[12]`."""
    for weight, bias in layers[:-1]:
        x = jnp.maximum(weight @ x + bias, 0.0)
    weight, bias = layers[-1]
    return jnp.tanh(weight @ x + bias)


def measure(layers, horizon, gamma, start):
    """Reach-avoid measure of one start."""

    def advance(carry, discount):
        x, fold = carry
        x = jnp.stack(peer.step(x, control(layers, x)))
        return (x, peer.judge(jnp, x, discount, *fold)), None

    fold = peer.judge(jnp, start, 1.0, jnp.float32(1e30), jnp.float32(-1e30))
    discounts = gamma ** jnp.arange(1, horizon + 1, dtype=jnp.float32)
    (_, (_, best)), _ = jax.lax.scan(advance, (start, fold), discounts)
    return best


def rollout(work, network, count):
    layers = [tuple(map(jnp.asarray, layer)) for layer in work.network(network)]
    one = partial(measure, layers, work.settings["horizon"], work.settings["gamma"])
    starts = jnp.asarray(work.starts[:count])
    each = jax.jit(jax.vmap(one)).lower(starts).compile()
    peer.check_measures(work, network, count, each(starts))
    return lambda: each(starts).block_until_ready()


def cost(mppi, controls):
    """Cost of the controls `[H, 3]` of one sample."""
    last = jnp.zeros(mppi["horizon"]).at[-1].set(1.0)

    def advance(carry, stage):
        (x, total), (u, last) = carry, stage
        total += peer.lane_cost(jnp, x, u, mppi["speed"], mppi["cost"], last)
        return (jnp.stack(peer.step(x, u)), total), None

    start = jnp.asarray(mppi["start"], jnp.float32)
    (_, total), _ = jax.lax.scan(advance, (start, jnp.float32(0.0)), (controls, last))
    return total


def improved(mppi, controls):
    """The plan `[H, 3]` of the samples `[K, H, 3]`."""
    weights = jax.nn.softmax(-jax.vmap(partial(cost, mppi))(controls) / mppi["temperature"])
    return jnp.einsum("k,kht->ht", weights, controls)


def plan(work, samples):
    mppi = work.settings["mppi"]

    def drawn(key):
        noise = mppi["sigma"] * jax.random.normal(key, (samples, mppi["horizon"], 3))
        return improved(mppi, jnp.clip(noise, -1.0, 1.0))

    ours = jnp.asarray(work.array("mppi_controls").reshape(-1, mppi["horizon"], 3))
    costs = jax.jit(jax.vmap(partial(cost, mppi)))(ours)
    peer.check_plan(work, costs, jax.jit(partial(improved, mppi))(ours))
    return keyed(drawn)


if __name__ == "__main__":
    peer.serve(f"JAX {jax.__version__} vmap", rollout, plan)
