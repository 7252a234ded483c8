//! What a tensor or a number that is no part of a network may have to do with it, told by its name.

use super::names::{split, starts_with};
use super::source::Amount;

/// Keys of what an optimiser or a trainer keeps.
const TRAINING: [&str; 6] = ["optim", "opt", "opt_state", "loops", "callbacks", "grad_scaler"];
/// What lies anywhere in such keys.
const WITHIN_TRAINING: [&str; 3] = ["optimizer", "optimiser", "scheduler"];
/// Ends of such keys.
const ENDS_TRAINING: [&str; 2] = ["_opt", "_optim"];
/// Beginnings of the keys of networks that judge, or are copies: each with layers of its own.
const JUDGES: [&str; 12] = [
    "critic",
    "value",
    "vf",
    "qf",
    "q_net",
    "q1",
    "q2",
    "Q1",
    "Q2",
    "target_",
    "discriminator",
    "reward_net",
];
/// Such keys as a whole.
const WHOLE_JUDGES: [&str; 4] = ["v", "q", "V", "Q"];
/// Ends of such keys.
const ENDS_JUDGES: [&str; 3] = ["_critic", "_target", "_old"];
/// Normalisers of what a critic alone is given.
const CRITICS_OWN: [&str; 3] = ["critic_obs_norm", "privileged_obs_norm", "privileged_state"];
/// Logarithms of deviations and of the weight of the entropy.
const LOGARITHMS: [&str; 5] = ["log_std", "logstd", "log_std_param", "log_alpha", "log_ent_coef"];
/// Ends of the keys of the former, and of the layers that give them.
const ENDS_LOGARITHMS: [&str; 4] = ["_log_std", "_logstd", "log_std_layer", "log_std_linear"];
/// Keys of counts, sizes and constants of training, at the end of a name.
const COUNTS: [&str; 32] = [
    "training",
    "count",
    "num_batches_tracked",
    "step",
    "steps",
    "global_step",
    "num_steps",
    "total_steps",
    "timesteps",
    "num_timesteps",
    "total_timesteps",
    "epoch",
    "epochs",
    "current_epoch",
    "iter",
    "iters",
    "iteration",
    "iterations",
    "it",
    "episode",
    "episodes",
    "frame",
    "frames",
    "seed",
    "lr",
    "learning_rate",
    "gamma",
    "tau",
    "batch_size",
    "loss",
    "hidden_size",
    "last_mean_rewards",
];
/// Ends of such keys.
const ENDS_COUNTS: [&str; 5] = ["_loss", "_features", "_steps", "_epoch", "version"];
/// Modules of paths and times.
const INERT: [&str; 2] = ["pathlib", "datetime"];
/// Beginnings of the keys of the tensors of recurrent layers.
const RECURRENT: [&str; 6] =
    ["weight_ih", "weight_hh", "bias_ih", "bias_hh", "kernel_h", "recurrent"];
/// Keys of a weight that several tensors stand for.
const PARAMETRIZED: [&str; 5] =
    ["parametrizations", "weight_orig", "weight_g", "weight_u", "weight_v"];
/// Keys of layers that give deviations.
const DEVIATIONS: [&str; 4] = ["std", "stddev", "sigma", "log_sigma"];

/// What a tensor that is no part of the network may have to do with the policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bearing {
    /// Nothing: it trains or judges.
    None,
    /// It is a part of a layer with a memory.
    Memory,
    /// It may act on what the network is given or gives.
    Unknown,
}

/// Names of the layers of a file, and of those of the policy.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known<'a> {
    pub(super) all: &'a [&'a str],
    pub(super) own: &'a [&'a str],
}

impl Known<'_> {
    /// What the numbers `name` may have to do with the policy.
    pub(super) fn bearing(&self, name: &str, amount: Amount) -> Bearing {
        let last = name.rsplit('.').next().unwrap_or_default();
        let mut ends = name.match_indices('.').map(|(at, _)| at).chain([name.len()]);
        let beside = ends.any(|end| {
            let key = name[..end].rsplit('.').next().unwrap_or_default();
            trains(key) || (judges(key) && self.is_apart(&name[..end]))
        });
        match is_memory(last) {
            // Of several numbers, none is a count.
            _ if beside || (amount == Amount::One && is_count(last)) => Bearing::None,
            true => Bearing::Memory,
            false => Bearing::Unknown,
        }
    }

    /// Whether the module has layers, and none of the policy's.
    pub(super) fn is_apart(&self, module: &str) -> bool {
        self.all.iter().any(|layer| starts_with(layer, module))
            && !self.own.iter().any(|layer| starts_with(layer, module))
    }
}

/// Whether a key is one of training.
fn trains(key: &str) -> bool {
    TRAINING.contains(&key)
        || WITHIN_TRAINING.iter().any(|part| key.contains(part))
        || ENDS_TRAINING.iter().any(|end| key.ends_with(end))
        || CRITICS_OWN.iter().any(|begin| key.starts_with(begin))
        || is_logarithm(key)
}

/// Whether a key is that of a logarithm which only training and exploration need.
fn is_logarithm(key: &str) -> bool {
    LOGARITHMS.contains(&key) || ENDS_LOGARITHMS.iter().any(|end| key.ends_with(end))
}

/// Whether a key is that of a network that judges, or of a copy.
pub(super) fn judges(key: &str) -> bool {
    WHOLE_JUDGES.contains(&key)
        || JUDGES.iter().any(|begin| key.starts_with(begin))
        || ENDS_JUDGES.iter().any(|end| key.ends_with(end))
}

/// Whether a key is that of a count, or of a constant of training.
fn is_count(key: &str) -> bool {
    COUNTS.contains(&key) || ENDS_COUNTS.iter().any(|end| key.ends_with(end))
}

/// Whether an object of this class or function does nothing with numbers: a device or a kind of PyTorch, a path, a time.
pub(super) fn is_inert(maker: &str) -> bool {
    let (module, _) = split(maker);
    module == "torch" || INERT.contains(&module.split('.').next().unwrap_or_default())
}

/// Whether the last key of a tensor is that of a recurrent layer.
pub(super) fn is_memory(last: &str) -> bool {
    RECURRENT.iter().any(|begin| last.starts_with(begin))
}

/// Whether a tensor is one of several that a weight is computed from.
pub(super) fn is_parametrized(name: &str) -> bool {
    name.split('.').any(|key| PARAMETRIZED.contains(&key))
}

/// Whether the last key of a layer says that it gives deviations.
pub(super) fn gives_deviations(layer: &str) -> bool {
    let last = layer.rsplit('.').next().unwrap_or_default();
    DEVIATIONS.contains(&last) || (is_logarithm(last) && !last.contains("alpha"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_bears_on_a_policy_is_told_by_its_keys() {
        let all = ["critic.0", "actor_target.mu.0", "v.0", "value.pi.0"];
        let known = Known { all: &all, own: &["value.pi.0"] };
        for name in [
            "critic.0.weight",
            "critic.norm.scale",
            "actor_target.mu.0.bias",
            "v.0.bias",
            "optimizer.state.0",
            "pi_optimizer.lr",
            "log_std",
            "actor.logstd",
            "log_alpha",
            "epoch",
            "critic_obs_normalizer._mean",
        ] {
            assert_eq!(known.bearing(name, Amount::One), Bearing::None, "{name}");
        }
        for name in [
            "obs.std",
            "std",
            "sigma_in",
            "alpha",
            "lr_scale",
            "cost_scale",
            "target_offset",
            "q1.scale",
            "c.weight",
            "encoder_old.weight",
            "value_range",
            // The policy's own layers lie there.
            "value.scale",
            "obs_rms.mean",
            "action_scale",
        ] {
            assert_eq!(known.bearing(name, Amount::One), Bearing::Unknown, "{name}");
        }
        assert_eq!(known.bearing("epoch", Amount::Many), Bearing::Unknown);
        assert!(is_inert("torch.device") && !is_inert("torch.nn.Linear"));
        assert_eq!(known.bearing("value_rnn.weight_ih_l0", Amount::Many), Bearing::Memory);
        assert!(is_parametrized("0.parametrizations.weight.original0"));
        assert!(gives_deviations("actor.log_std") && !gives_deviations("actor.mean"));
    }
}
